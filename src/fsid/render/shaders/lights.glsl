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
layout(binding = 3) uniform sampler2D shadow_depth;

const int SEARCH_TAPS = 12;
const int FILTER_TAPS = 28;
const float BORDER = 0.17;       // of a tile, tangent units: fsid.render.shadows.BORDER
const float MAX_FILTER = 0.16;
const float SHADOW_NEAR = 0.02;
const float BIAS_M = 0.0015;
uniform vec2 search_taps[SEARCH_TAPS];   // Vogel spirals on the unit disc
uniform vec2 filter_taps[FILTER_TAPS];
uniform float tile_px;
const int TILE_COLUMNS = 6;

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

// Share of the light's sphere seen from `position`: percentage-closer soft shadows (Fernando 2005) with
// fixed taps; every tap compares against the depth of the receiver's own plane there.
float visibility(Light light, vec3 position, vec3 face_normal) {
    Field field = field_of(light, position - light.position.xyz, face_normal);
    vec3 q = field.q, n = field.n;
    vec2 atlas = vec2(textureSize(shadow_depth, 0));
    vec2 corner = vec2(field.tile % TILE_COLUMNS, field.tile / TILE_COLUMNS) * tile_px;
    vec2 centre = q.xy / q.z;
    float inverse_z = 1.0 / q.z;
    float texel = 2.0 / (field.focal * tile_px);   // tangent units

    // 1 / z of the plane is linear in the tangent coordinates; steep planes are limited.
    float facing = dot(n, q);
    vec2 slope = n.xy / (abs(facing) > 1e-6 ? facing : 1e-6);
    float steep = length(slope) * q.z;
    slope *= min(1.0, 12.0 / max(steep, 1e-6));
    float bias = (abs(slope.x) + abs(slope.y)) * texel + BIAS_M * inverse_z * inverse_z;

    vec2 to_atlas = 0.5 * field.focal * tile_px / atlas;
    vec2 uv = (corner + 0.5 * tile_px) / atlas + to_atlas * centre;
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
    if (found == float(SEARCH_TAPS)) return 0.0;

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
    vec3 f = f0 + (1.0 - f0) * pow(1.0 - clamp(dot(v, h), 0.0, 1.0), 5.0);
    return f * (d * 0.5 * nl / max(g, 1e-4));
}
