// Point and spot lights, their shadows, and the GGX reflection of one light. See fsid.render.shadows.
struct Light {
    vec4 position;    // xyz; w: radius of the emitting sphere
    vec4 direction;   // of a spot; w: cosine of the half cone, below -1 for a point light
    vec4 colour;      // rgb radiant intensity; w: cosine at which a spot reaches full strength
    ivec4 tiles;      // x: first tile, y: number of tiles (1 or 6)
};
struct Tile {
    vec4 right, up, forward;   // xyz world; forward.w: focal length in half tiles
    vec4 place;                // xy: lower corner, zw: size, in the atlas 0..1
};
layout(std430, binding = 1) readonly buffer Lights { Light lights[]; };
layout(std430, binding = 2) readonly buffer Tiles { Tile tiles[]; };
uniform int light_count;
layout(binding = 2) uniform sampler2DShadow shadow_compare;
layout(binding = 3) uniform sampler2D shadow_depth;

const int SEARCH_TAPS = 12;
const int FILTER_TAPS = 28;
const float MAX_FILTER = 0.16;   // tangent units; the tiles carry a border of that width
const float SHADOW_NEAR = 0.02;
const float BIAS_M = 0.0015;
uniform vec2 search_taps[SEARCH_TAPS];   // Vogel spirals on the unit disc
uniform vec2 filter_taps[FILTER_TAPS];
uniform float tile_px;

int tile_of(Light light, vec3 d) {
    if (light.tiles.y == 1) return light.tiles.x;
    vec3 a = abs(d);
    int axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
    return light.tiles.x + 2 * axis + (d[axis] < 0.0 ? 1 : 0);
}

// Share of the light's sphere seen from `position`: percentage-closer soft shadows (Fernando 2005) with
// fixed taps; every tap compares against the depth of the receiver's own plane there.
float visibility(Light light, vec3 position, vec3 face_normal) {
    vec3 d = position - light.position.xyz;
    Tile tile = tiles[tile_of(light, d)];
    vec3 q = vec3(dot(tile.right.xyz, d), dot(tile.up.xyz, d), dot(tile.forward.xyz, d));
    vec3 n = vec3(dot(tile.right.xyz, face_normal), dot(tile.up.xyz, face_normal), dot(tile.forward.xyz, face_normal));
    float focal = tile.forward.w;
    vec2 centre = q.xy / q.z;
    float inverse_z = 1.0 / q.z;
    float texel = 2.0 / (focal * tile_px);                      // tangent units

    // 1 / z of the plane is linear in the tangent coordinates; steep planes are limited.
    float facing = dot(n, q);
    vec2 slope = n.xy / (abs(facing) > 1e-6 ? facing : 1e-6);
    float steep = length(slope) * q.z;
    slope *= min(1.0, 12.0 / max(steep, 1e-6));
    float bias = (abs(slope.x) + abs(slope.y)) * texel + BIAS_M * inverse_z * inverse_z;

    vec2 to_atlas = 0.5 * focal * tile.place.zw;
    vec2 uv = tile.place.xy + 0.5 * tile.place.zw + to_atlas * centre;
    float radius = light.position.w;
    float search = clamp(2.0 * radius * inverse_z, texel, MAX_FILTER);
    float found = 0.0, found_inverse_z = 0.0;
    for (int i = 0; i < SEARCH_TAPS; ++i) {
        vec2 offset = search * search_taps[i];
        float limit = inverse_z + dot(slope, offset) + bias;
        float other = (1.0 - textureLod(shadow_depth, uv + to_atlas * offset, 0.0).r) / SHADOW_NEAR;
        if (other > limit) {
            found += 1.0;
            found_inverse_z += other;
        }
    }
    if (found == 0.0) return 1.0;

    float blocker = found_inverse_z / found;
    float spread = clamp(radius * (blocker - inverse_z), 0.75 * texel, search);
    float lit = 0.0;
    for (int i = 0; i < FILTER_TAPS; ++i) {
        vec2 offset = spread * filter_taps[i];
        float limit = inverse_z + dot(slope, offset) + bias;
        lit += textureLod(shadow_compare, vec3(uv + to_atlas * offset, 1.0 - SHADOW_NEAR * limit), 0.0);
    }
    return lit / float(FILTER_TAPS);
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
    vec3 f = f0 + (1.0 - f0) * pow(1.0 - max(dot(v, h), 0.0), 5.0);
    return f * (d * 0.5 * nl / max(g, 1e-4));
}
