// Point and spot lights, their shadows, and the GGX reflection of one light. See fsid.render.shadows.
struct Light {
    vec4 position;      // xyz; w: radius of the emitting sphere
    vec4 direction;     // of a spot; w: cosine of the half cone, below -1 for a point light
    vec4 colour;        // rgb radiant intensity; w: cosine at which a spot reaches full strength
    vec4 right, up;     // with direction the axes of a light that has one tile; right.w: its focal length
    ivec4 tiles;        // x: first tile; y: number of tiles, 1 or 6 (the sides +x -x +y -y +z -z)
};
layout(std430, binding = 1) readonly buffer Lights { Light lights[]; };
uniform int light_count;
layout(binding = 2) uniform sampler2DShadow shadow_compare;
layout(binding = 3) uniform sampler2D shadow_moments;   // means of 1 / z and 1 / z^2, half the size, with mips

const int SEARCH_TAPS = 12;
const int SHARP_TAPS = 20;
const int SOFT_TAPS = 20;
const float BORDER = 0.17;       // of a tile, tangent units: fsid.render.shadows.BORDER
const float MAX_FILTER = 0.16;
const float SHADOW_NEAR = 0.02;
const float BIAS_M = 0.0015;
const float SHARP_TEXELS = 3.0, SOFT_TEXELS = 8.0;   // radius of the penumbra: below, above, blended between
const float LEAK = 0.08;         // share of light that overlapping occluders let through, cut off
const int TILE_COLUMNS = 6;
uniform vec2 search_taps[SEARCH_TAPS];   // Vogel spirals on the unit disc
uniform vec2 filter_taps[SOFT_TAPS];
uniform float tile_px;

struct Field {
    vec3 q, n;      // position and normal in the tile's axes: right, up, forward
    float focal;    // in half tiles
    int tile;
};

Field field_of(Light light, vec3 d, vec3 n) {
    if (light.tiles.y == 1) {
        mat3 axes = transpose(mat3(light.right.xyz, light.up.xyz, light.direction.xyz));
        return Field(axes * d, axes * n, light.right.w, light.tiles.x);
    }
    vec3 a = abs(d);
    const float focal = 1.0 / (1.0 + BORDER);
    if (a.x >= a.y && a.x >= a.z) {
        float side = d.x < 0.0 ? -1.0 : 1.0;
        return Field(vec3(d.yz, a.x), vec3(n.yz, side * n.x), focal, light.tiles.x + (d.x < 0.0 ? 1 : 0));
    }
    if (a.y >= a.z) {
        float side = d.y < 0.0 ? -1.0 : 1.0;
        return Field(vec3(d.zx, a.y), vec3(n.zx, side * n.y), focal, light.tiles.x + (d.y < 0.0 ? 3 : 2));
    }
    float side = d.z < 0.0 ? -1.0 : 1.0;
    return Field(vec3(d.xy, a.z), vec3(n.xy, side * n.z), focal, light.tiles.x + (d.z < 0.0 ? 5 : 4));
}

// Where a receiver is in its tile. 1 / z of the receiver's plane is linear in the tangent coordinates.
struct Receiver {
    vec2 corner, centre;   // of the tile and of the receiver, 0..1 of the atlas
    vec2 to_atlas;         // tangent units to 0..1 of the atlas
    vec2 slope;            // of 1 / z of the plane
    float inverse_z;
    float texel;           // of the depth, tangent units
    float bias;            // of 1 / z
    float tile_size;       // tangent units
};

Receiver receiver_of(Field field) {
    vec3 q = field.q, n = field.n;
    Receiver r;
    vec2 atlas = 2.0 * vec2(textureSize(shadow_moments, 0));
    r.inverse_z = 1.0 / q.z;
    r.tile_size = 2.0 / field.focal;
    r.texel = r.tile_size / tile_px;
    r.to_atlas = tile_px / (atlas * r.tile_size);
    r.corner = vec2(field.tile % TILE_COLUMNS, field.tile / TILE_COLUMNS) * tile_px / atlas;
    r.centre = r.corner + r.to_atlas * (0.5 * r.tile_size + q.xy * r.inverse_z);
    float facing = dot(n, q);
    r.slope = n.xy / (abs(facing) > 1e-6 ? facing : 1e-6);
    r.slope *= min(1.0, 12.0 / max(length(r.slope) * q.z, 1e-6));   // steep planes are limited
    r.bias = BIAS_M * r.inverse_z * r.inverse_z;
    return r;
}

// Light that reaches the receiver's plane at `offset` past what the shadow map holds within `width` of there
// (both tangent units), by Chebyshev's inequality (Donnelly and Lauritzen 2006); exact for one occluder
// in front of the plane. blocked: summed 1 / z of the occluders (Yang et al. 2010).
float soft_tap(Receiver r, vec2 offset, float width, out float blocked) {
    vec2 inside = r.to_atlas * min(width, 0.5 * r.tile_size);
    vec2 uv = clamp(r.centre + r.to_atlas * offset, r.corner + inside, r.corner + r.to_atlas * r.tile_size - inside);
    float level = log2(max(width / (2.0 * r.texel), 1.0));
    vec2 moments = textureLod(shadow_moments, uv, level).xy;
    float limit = r.inverse_z + dot(r.slope, (uv - r.centre) / r.to_atlas);
    float in_front = max(moments.x - limit - r.bias, 0.0);
    float variance = max(moments.y - moments.x * moments.x, 0.0);
    float lit = in_front > 0.0 ? variance / (variance + in_front * in_front) : 1.0;
    blocked = moments.x - lit * limit;
    return lit;
}

// Percentage-closer filter on the depth itself, where the penumbra is a few texels.
float sharp_filter(Receiver r, float radius) {
    float bias = r.bias + (abs(r.slope.x) + abs(r.slope.y)) * r.texel;
    float lit = 0.0;
    for (int i = 0; i < SHARP_TAPS; ++i) {
        vec2 offset = radius * filter_taps[i];
        float limit = r.inverse_z + dot(r.slope, offset) + bias;
        lit += textureLod(shadow_compare, vec3(r.centre + r.to_atlas * offset, 1.0 - SHADOW_NEAR * limit), 0.0);
    }
    return lit / float(SHARP_TAPS);
}

float soft_filter(Receiver r, float radius) {
    float lit = 0.0, ignored;
    for (int i = 0; i < SOFT_TAPS; ++i) lit += soft_tap(r, radius * filter_taps[i], 0.3 * radius, ignored);
    return clamp((lit / float(SOFT_TAPS) - LEAK) / (1.0 - LEAK), 0.0, 1.0);
}

// Share of the light's sphere seen from `position`: soft shadows by the mean depth of what is in the way
// (Fernando 2005), with fixed taps that are areas and not points, so that they leave no pattern.
float visibility(Light light, vec3 position, vec3 face_normal) {
    Receiver r = receiver_of(field_of(light, position - light.position.xyz, face_normal));
    float radius = light.position.w;
    float search = clamp(2.0 * radius * r.inverse_z, 2.0 * r.texel, MAX_FILTER);
    float shaded = 0.0, blocked_sum = 0.0;
    for (int i = 0; i < SEARCH_TAPS; ++i) {
        float blocked;
        shaded += 1.0 - soft_tap(r, search * search_taps[i], 0.3 * search, blocked);
        blocked_sum += blocked;
    }
    if (shaded < 1e-4) return 1.0;
    float blocker = blocked_sum / shaded;
    float spread = clamp(radius * (blocker - r.inverse_z), 0.75 * r.texel, search);
    float soft = smoothstep(SHARP_TEXELS, SOFT_TEXELS, spread / r.texel);
    float lit = 0.0;
    if (soft < 1.0) lit += (1.0 - soft) * sharp_filter(r, spread);
    if (soft > 0.0) lit += soft * soft_filter(r, spread);
    return lit;
}

// Irradiance at normal incidence, without shadow; to_light is unit.
vec3 arriving(Light light, vec3 to_light, float distance_m) {
    float reach = max(distance_m, light.position.w);
    float cone = light.direction.w < -1.0 ? 1.0
        : smoothstep(light.direction.w, light.colour.w, dot(light.direction.xyz, -to_light));
    return light.colour.rgb * (cone / (reach * reach));
}

// GGX with height-correlated Smith masking (Heitz 2014) and Schlick's Fresnel: f * cos at the light.
vec3 reflected(vec3 f0, float alpha, vec3 n, vec3 v, vec3 l) {
    vec3 h = normalize(v + l);
    float nl = max(dot(n, l), 0.0), nv = max(abs(dot(n, v)), 1e-3), nh = max(dot(n, h), 0.0);
    float a2 = alpha * alpha;
    float t = nh * nh * (a2 - 1.0) + 1.0;
    float d = a2 / (3.14159265 * t * t);
    float g = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
    vec3 f = f0 + (1.0 - f0) * pow(1.0 - clamp(dot(v, h), 0.0, 1.0), 5.0);
    return f * (d * 0.5 * nl / max(g, 1e-4));
}
