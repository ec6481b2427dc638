// The surroundings as a light source: see fsid.render.room. Sides in the order +x -x +y -y +z -z.
layout(binding = 4) uniform sampler2DArray room_radiance;
uniform vec3 ambient_even[3];    // by axis: mean of irradiance / pi towards its two directions
uniform vec3 ambient_odd[3];     // and half of what more comes from the positive one
uniform vec3 mean_sides[6];      // mean of room_radiance over each side
uniform vec3 room_half;          // half size of the room; under the sky so large that places do not matter
uniform vec3 room_centre;

// Ambient light on a surface of normal n, irradiance / pi.
vec3 ambient_on(vec3 n) {
    vec3 even = n * n;
    vec3 light = even.x * ambient_even[0] + even.y * ambient_even[1] + even.z * ambient_even[2]
               + n.x * ambient_odd[0] + n.y * ambient_odd[1] + n.z * ambient_odd[2];
    return max(light, 0.0);
}

// A value per side as a smooth function of direction: the ambient cube (McTaggart 2004), weights sum to one.
vec3 cube(vec3 sides[6], vec3 n) {
    vec3 w = n * n;
    return w.x * (n.x < 0.0 ? sides[1] : sides[0]) + w.y * (n.y < 0.0 ? sides[3] : sides[2])
         + w.z * (n.z < 0.0 ? sides[5] : sides[4]);
}

// Which part of a lobe of half width `wide` around r meets walls of one axis before walls of another: the room's edges
// divide it. i, j: distances to the walls of either axis, positive side first; ri, rj: of r. For the pairs ++ +- -+ --.
vec4 met_before(vec2 i, float ri, vec2 j, float rj, float wide) {
    vec4 a = i.xxyy, b = j.xyxy;
    vec4 apart = (vec4(ri, ri, -ri, -ri) * b - vec4(rj, -rj, rj, -rj) * a) * inversesqrt(max(a * a + b * b, 1e-12));
    return smoothstep(-wide, wide, apart);
}

const float LOBE_WIDTH = 4.0;   // alpha: beyond lie 5 % of what GGX mirrors in one direction
const float LEAST_WALL = 0.01;  // share of a lobe that is looked up

// What a mirror of roughness alpha at `position` sees in direction r, a unit vector: the walls that a lobe around it
// meets, and the rougher it is the more of whole walls.
vec3 mirrored(vec3 position, vec3 r, float alpha) {
    vec3 p = clamp(position - room_centre, -room_half, room_half);
    vec3 ray = mix(r, vec3(1e-6), lessThan(abs(r), vec3(1e-6)));
    vec3 t = (sign(ray) * room_half - p) / ray;
    float reach = min(t.x, min(t.y, t.z));
    vec3 at = 0.5 + 0.5 * (p + ray * reach) / room_half;
    float texels = float(textureSize(room_radiance, 0).x);
    float width = 2.0 * min(room_half.x, min(room_half.y, room_half.z)) / texels;
    float level = min(log2(1.0 + 2.0 * alpha * reach / width), log2(texels));
    vec3 ahead = room_half - p, behind = room_half + p;
    float wide = max(LOBE_WIDTH * alpha, 1e-3);
    vec4 xy = met_before(vec2(ahead.x, behind.x), ray.x, vec2(ahead.y, behind.y), ray.y, wide);
    vec4 yz = met_before(vec2(ahead.y, behind.y), ray.y, vec2(ahead.z, behind.z), ray.z, wide);
    vec4 zx = met_before(vec2(ahead.z, behind.z), ray.z, vec2(ahead.x, behind.x), ray.x, wide);
    vec4 yx = 1.0 - xy, zy = 1.0 - yz, xz = 1.0 - zx;
    float share[6] = float[](xy[0] * xy[1] * xz[0] * xz[2], xy[2] * xy[3] * xz[1] * xz[3],
                             yz[0] * yz[1] * yx[0] * yx[2], yz[2] * yz[3] * yx[1] * yx[3],
                             zx[0] * zx[1] * zy[0] * zy[2], zx[2] * zx[3] * zy[1] * zy[3]);
    int first = t.x <= reach ? 0 : t.y <= reach ? 2 : 4;
    uint left = 1u << (first + (ray[first / 2] < 0.0 ? 1 : 0));
    float whole = smoothstep(0.0, 0.4, alpha);    // from 1 on no single wall counts
    for (int side = 0; side < 6; ++side) left |= share[side] > LEAST_WALL && whole < 1.0 ? 1u << side : 0u;
    vec4 wall = vec4(0);
    do {
        int side = findLSB(left), axis = side / 2;
        left &= left - 1u;
        vec2 uv = vec2(at[(axis + 1) % 3], at[(axis + 2) % 3]);
        wall += (share[side] + 1e-6) * vec4(textureLod(room_radiance, vec3(uv, side), level).rgb, 1.0);
    } while (left != 0u);
    return mix(wall.rgb / wall.a, cube(mean_sides, r), whole);
}

// Share of the surroundings that a surface reflects specularly: scale and offset of f0, and that of a clear coat
// (fsid.render.reflectance). In the upper half of the table the bent cosine that such a lobe is (tools/fit_lobes.py): a, b, c, d.
layout(binding = 14) uniform sampler2D reflectance;
const float TABLE_EDGE = 0.5 / 32.0;
vec4 reflectance_at(float roughness, float nv, float part) {
    vec2 at = clamp(vec2(nv, roughness), TABLE_EDGE, 1.0 - TABLE_EDGE);
    return textureLod(reflectance, vec2(at.x, 0.5 * (at.y + part)), 0.0);
}
vec2 mirror_share(float roughness, float nv) { return reflectance_at(roughness, nv, 0.0).xy; }

// Bends directions so that GGX's lobe of a surface n seen from v becomes a cosine around z.
mat3 lobe_of(float roughness, vec3 n, vec3 v) {
    vec4 w = reflectance_at(roughness, max(abs(dot(n, v)), 1e-3), 1.0);
    vec3 aside = v - n * dot(n, v);
    aside = dot(aside, aside) > 1e-8 ? normalize(aside) : normalize(cross(n, abs(n.x) < 0.7 ? vec3(1, 0, 0) : vec3(0, 1, 0)));
    return mat3(w.x, 0.0, w.w, 0.0, w.z, 0.0, w.y, 0.0, 1.0) * transpose(mat3(aside, cross(n, aside), n));
}
