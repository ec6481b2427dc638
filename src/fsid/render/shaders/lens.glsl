// Pixels of the image -> rays -> samples of the G-buffer, which is a pinhole image.
// LENS: 0 pinhole, 1 Brown-Conrady, 2 fisheye.
uniform ivec2 size;        // of the image, pixels
uniform ivec2 seen;        // of the G-buffer, pixels
uniform vec2 focal;        // of the image's camera, half image sizes
uniform vec2 seen_focal;   // of the G-buffer's
uniform vec2 seen_shift;   // of the G-buffer, half image sizes
uniform vec2 shift;        // of the image, pixels
uniform vec2 lens_offset;  // of the rays (x, y): place on the lens / distance of the sharp plane
uniform float k[5];

// Distorted image coordinates of normalised ones (x right, y down), and the inverse, by Newton's method.
#if LENS == 0
vec2 distorted(vec2 p) { return p; }
vec2 undistorted(vec2 d) { return d; }
#elif LENS == 1
vec2 distorted(vec2 p) {
    float x = p.x, y = p.y, r2 = dot(p, p);
    return p * (1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4])))
         + vec2(2.0 * k[2] * x * y + k[3] * (r2 + 2.0 * x * x), k[2] * (r2 + 2.0 * y * y) + 2.0 * k[3] * x * y);
}
vec2 undistorted(vec2 d) {
    vec2 p = d;
    for (int i = 0; i < 12; ++i) {
        float x = p.x, y = p.y, r2 = dot(p, p);
        float radial = 1.0 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
        float growth = 2.0 * (k[0] + r2 * (2.0 * k[1] + r2 * 3.0 * k[4]));
        vec2 f = distorted(p) - d;
        float a = radial + growth * x * x + 2.0 * k[2] * y + 6.0 * k[3] * x;
        float b = growth * x * y + 2.0 * k[2] * x + 2.0 * k[3] * y;
        float e = radial + growth * y * y + 6.0 * k[2] * y + 2.0 * k[3] * x;
        p -= vec2(e * f.x - b * f.y, a * f.y - b * f.x) / (a * e - b * b);
    }
    return p;
}
#else
vec2 distorted(vec2 p) {
    float r = length(p), theta = atan(r), t2 = theta * theta;
    float bent = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
    return p * (r > 1e-9 ? bent / r : 1.0);
}
vec2 undistorted(vec2 d) {
    float wanted = length(d), theta = min(wanted, 1.4);
    for (int i = 0; i < 12; ++i) {
        float t2 = theta * theta;
        float value = theta * (1.0 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))));
        float growth = 1.0 + t2 * (3.0 * k[0] + t2 * (5.0 * k[1] + t2 * (7.0 * k[2] + t2 * 9.0 * k[3])));
        theta -= (value - wanted) / growth;
    }
    return d * (wanted > 1e-9 ? tan(theta) / wanted : 1.0);
}
#endif

// The ray through a point of the image (pixels): x right, y up, and 1 along the viewing axis.
vec3 ray_at(vec2 pixel) {
    vec2 ndc = (pixel - shift) / vec2(size) * 2.0 - 1.0;
    vec2 p = undistorted(ndc / focal);
    return vec3(vec2(p.x, -p.y) - lens_offset, 1.0);
}

// Where the image shows a point (x right, y up, z forward), in its pixels. A bent lens shows what the G-buffer
// does not reach at its border: beyond, its formula may fold back into the image.
vec2 pixel_of(vec3 local) {
    vec2 p = local.xy / max(local.z, 1e-3) + lens_offset;
    p.y = -p.y;
#if LENS > 0
    p = distorted(clamp(p, -1.0 / seen_focal, 1.0 / seen_focal));
#endif
    return (p * focal * 0.5 + 0.5) * vec2(size) + shift;
}

// Where the G-buffer sees a ray, in its pixels.
vec2 seen_at(vec3 ray) {
    return ((vec2(ray.x, -ray.y) * seen_focal + seen_shift) * 0.5 + 0.5) * vec2(seen);
}

// The ray through a point of the G-buffer, in its pixels.
vec3 seen_ray(vec2 pixel) {
    vec2 p = (pixel / vec2(seen) * 2.0 - 1.0 - seen_shift) / seen_focal;
    return vec3(p.x, -p.y, 1.0);
}

// The G-buffer's texel that stands for a block of 2 x 2 pixels, and where that is, in its pixels.
ivec2 block_texel(ivec2 block) {
    return clamp(block * (2 * GRID) + GRID, ivec2(0), seen * GRID - 1);
}
vec2 block_place(ivec2 block) { return (vec2(block_texel(block)) + 0.5) / float(GRID); }
