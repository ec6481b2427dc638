// Material evaluation: box mapping in metres, blended where the surface turns from one axis to the next.
// Loops test at their end, as in lights.glsl.
layout(binding = 8) uniform sampler2DArray masks;    // mix, pattern, detail, roughness
layout(binding = 9) uniform sampler2DArray relief;   // slope u, slope v, spread, metallic
uniform float max_probes;

const float BLEND = 0.2;          // axes whose component is this close to the largest one are blended
const float MIN_ROUGHNESS = 0.18; // bounds the highlight: alpha >= 0.032
const float SLOPE_LEVELS = 127.0;
const float DETAIL = 2.0 * 255.0 / 254.0;  // neutral detail is stored exactly
const float SHARPEN = 0.75;       // of the footprint: a trilinear probe is wider than a pixel

const float PATCHES = 1.5;        // per edge of a tile
const float LEAST_SHARE = 0.01;   // of a patch that is looked up

struct Matter {
    vec3 albedo;
    vec3 normal;      // world, with relief
    float alpha2;     // GGX
    float lost;       // what the relief within the pixel adds to alpha2, of every layer
    float metallic;
};

// Directions in which the texture's u and v grow on the faces of a box; v grows downwards.
void face_axes(int axis, float side, out vec3 u, out vec3 v) {
    u = axis == 0 ? vec3(0, side, 0) : axis == 1 ? vec3(-side, 0, 0) : vec3(1, 0, 0);
    v = axis == 2 ? vec3(0, -side, 0) : vec3(0, 0, -1);
}

vec3 into(vec3 rows[3], vec3 world) { return world.x * rows[0] + world.y * rows[1] + world.z * rows[2]; }
vec3 out_of(vec3 rows[3], vec3 v) { return vec3(dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)); }

// A place of the tile for every patch: pcg2d of Jarzynski and Olano 2020.
vec2 place_of(ivec2 patch_index) {
    uvec2 v = uvec2(patch_index) * 1664525u + 1013904223u;
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    v ^= v >> 16u;
    v.x += v.y * 1664525u;
    v.y += v.x * 1664525u;
    v ^= v >> 16u;
    return vec2(v >> 8u) / 16777216.0;
}

// A pixel's footprint has the second moments of the ellipse whose axes are those of (gx gy), however gx and gy
// lie to each other (Heckbert 1989): the longer one, and the length of the shorter.
vec2 longest_axis(vec2 gx, vec2 gy, out float shorter) {
    float lx = dot(gx, gx), ly = dot(gy, gy), both = dot(gx, gy);
    float most = 0.5 * (lx + ly + sqrt((lx - ly) * (lx - ly) + 4.0 * both * both));
    vec2 share = lx >= ly ? vec2(most - ly + 1e-30, both) : vec2(both, most - lx + 1e-30);
    shorter = abs(gx.x * gy.y - gx.y * gy.x) * inversesqrt(max(most, 1e-30));
    return (share.x * gx + share.y * gy) * inversesqrt(max(dot(share, share), 1e-36));
}

// Patches of a texture without order, from random places of its tile (Heitz and Neyret 2018): the three patches
// around uv, corners of a grid of triangles, with their share of it, and where in the tile each is cut out.
void patches_at(vec2 uv, out vec3 share, out vec2 cut[3]) {
    vec2 skewed = mat2(1.0, 0.0, -0.57735027, 1.15470054) * (uv * PATCHES);
    ivec2 corner = ivec2(floor(skewed));
    vec2 f = skewed - vec2(corner);
    bool upper = f.x + f.y > 1.0;
    share = upper ? vec3(f.x + f.y - 1.0, 1.0 - f.y, 1.0 - f.x) : vec3(1.0 - f.x - f.y, f.y, f.x);
    share *= share;
    share *= share;
    share *= share;
    share /= share.x + share.y + share.z;
    cut[0] = place_of(corner + (upper ? ivec2(1, 1) : ivec2(0, 0)));
    cut[1] = place_of(corner + (upper ? ivec2(1, 0) : ivec2(0, 1)));
    cut[2] = place_of(corner + (upper ? ivec2(0, 1) : ivec2(1, 0)));
}

// position, normal: world. dx, dy: from this pixel's position to those of its neighbours.
Matter matter_at(Surface s, vec3 position, vec3 normal, vec3 dx, vec3 dy) {
    vec3 n = into(s.place, normal);
    vec3 metric = into(s.place, position - s.position);
    vec3 mx = into(s.place, dx), my = into(s.place, dy);
    vec3 size = abs(n);
    vec3 weight = max(size - (max(size.x, max(size.y, size.z)) - BLEND), 0.0);
    weight *= weight;
    weight /= weight.x + weight.y + weight.z;
    uint left = uint(weight.x > 1e-3) | (uint(weight.y > 1e-3) << 1) | (uint(weight.z > 1e-3) << 2);
    vec4 mask = vec4(0), other = vec4(0);
    vec3 gradient = vec3(0);
    float total = 0.0, texels = float(textureSize(masks, 0).x);
    do {
        int axis = findLSB(left);
        left &= left - 1u;
        vec3 u, v;
        face_axes(axis, n[axis] < 0.0 ? -1.0 : 1.0, u, v);
        vec3 tu = s.turn.x * u + s.turn.y * v;
        vec3 tv = s.turn.x * v - s.turn.y * u;
        vec2 uv = vec2(dot(tu, metric), dot(tv, metric)) * s.tiles_per_m + vec2(0.37, 0.61) * float(axis);
        vec2 gx = vec2(dot(tu, mx), dot(tv, mx)) * s.tiles_per_m;
        vec2 gy = vec2(dot(tu, my), dot(tv, my)) * s.tiles_per_m;
        // Long footprints are covered by several probes along their length: written out, because drivers
        // differ in their anisotropic filter (and some take seconds for one frame of it).
        float reach;
        vec2 along = longest_axis(gx, gy, reach);
        float longest = SHARPEN * length(along), across = max(SHARPEN * reach, 1e-8);
        int probes = int(clamp(ceil(longest / across - 0.25), 1.0, max_probes));
        float level = log2(max(longest / float(probes), across) * texels);
        vec3 share = vec3(1.0, 0.0, 0.0);
        vec2 cut[3] = vec2[](vec2(0.0), vec2(0.0), vec2(0.0));
        if (s.patched) patches_at(uv, share, cut);
        vec4 m = vec4(0), r = vec4(0);
        float found = 0.0;
        int patch_index = 0, patch_count = s.patched ? 3 : 1;
        do {
            float part = share[patch_index] / float(probes);
            if (share[patch_index] > LEAST_SHARE) {
                int k = 0;
                do {
                    vec2 step = along * ((float(k) + 0.5) / float(probes) - 0.5);
                    vec3 probe = vec3(uv + cut[patch_index] + step, s.layer);
                    m += part * textureLod(masks, probe, level);
                    r += part * textureLod(relief, probe, level);
                } while (++k < probes);
                found += share[patch_index];
            }
        } while (++patch_index < patch_count);
        m /= found;
        r /= found;
        r.z *= min(exp2(level), 1.0);   // of a large texel a pixel covers a part
        vec2 slope = (r.xy * 255.0 - 128.0) / SLOPE_LEVELS * s.slope_scale;
        mask += weight[axis] * m;
        other += weight[axis] * r;
        gradient += weight[axis] * (slope.x * tu + slope.y * tv);
        total += weight[axis];
    } while (left != 0u);
    mask /= total;
    other /= total;
    gradient /= total;
    float roughness = clamp(mask.a * s.roughness_scale, MIN_ROUGHNESS, 1.0);
    float spread = other.b * s.slope_scale;
    vec3 base = mix(mix(s.colour_a, s.colour_b, mask.r), s.colour_c, mask.g);
    Matter matter;
    matter.albedo = clamp(base * (mask.b * DETAIL), 0.0, 1.0);
    matter.normal = out_of(s.place, normalize(n - (gradient - n * dot(n, gradient))));
    matter.alpha2 = roughness * roughness * roughness * roughness;
    matter.lost = 2.0 * spread * spread;
    matter.metallic = other.a;
    return matter;
}
