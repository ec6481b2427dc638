// Lights: see fsid.render.shadows for the table and fsid.scene.model.Light for the units.
// Loops test at their end: llvmpipe has no other jump than back, so that every other loop runs once more than
// needed, and both sides of every branch run.
TEXELS(6, rgba32f, light_table);
uniform int light_count;

const int LIGHT_TEXELS = 8;
const int POINT = 0, SUN = 1, AREA = 2;
const float SHAPED = -3.0;    // fsid.render.shadows
const float PI = 3.14159265;

struct Light {
    vec3 position;
    float radius_m;          // of the sphere; of the sun the tangent of its angular radius
    vec3 direction;
    float cos_outer, cos_inner;
    vec3 colour;
    vec3 right, up;          // with direction the axes of a light that has one tile
    float focal, border;     // of the tiles: in half tiles; tangent units
    int kind, first_tile, tile_count;
    float range_m;           // of the sun's tile
    vec3 half_width, half_height;   // of an area light; of the sun where its nearer tile is, see _fill_nearer
                                    // of a lamp its shape, see _fill_shape
};

Light light_at(int i) {
    vec4 t[LIGHT_TEXELS];
    for (int k = 0; k < LIGHT_TEXELS; ++k) t[k] = FETCH(light_table, ivec2(k, i));
    return Light(t[0].xyz, t[0].w, t[1].xyz, t[1].w, t[2].w, t[2].rgb, t[3].xyz, t[4].xyz, t[3].w, t[4].w,
                 int(t[5].x), int(t[5].y), int(t[5].z), t[5].w, t[6].xyz, t[7].xyz);
}

// Irradiance at normal incidence of a point, spot or sun, without shadow; to_light is unit. A lamp of a shape is an
// ellipsoid: along an axis of half length c, where it shows the disc of radius a, I / (d^2 + a^2 - c^2) is exact.
vec3 arriving(Light light, vec3 to_light, float distance_m) {
    float reach = light.kind == SUN ? 1.0 : max(distance_m, light.radius_m), reach2 = reach * reach;
    vec3 l = to_light;
    float squared = max(dot(light.half_width, l * l) + 2.0 * dot(light.half_height, l.yzx * l.zxy), 0.0);
    float shown = sqrt(squared), disc = light.radius_m * light.radius_m * shown;
    float nearer = light.radius_m * light.radius_m * light.cos_inner / max(squared, 1e-3);
    bool shaped = light.cos_outer < SHAPED + 0.5;
    float share = shaped ? shown : light.cos_outer < -1.0 ? 1.0
        : smoothstep(light.cos_outer, light.cos_inner, dot(light.direction, -to_light));
    return light.colour * (share / (shaped ? max(distance_m * distance_m + disc - nearer, disc) : reach2));
}

// Angle between unit vectors over its sine, from their cosine in 0..1: within 7e-7 (tools/fit_arc.py).
float arc(float cosine) {
    return (1.57079534 + cosine * (0.90187848 + cosine * 0.02565153))
         / (1.0 + cosine * (1.21072969 + cosine * 0.28759566));
}

// Integral of cos(theta) / pi around z over a rectangle above the horizon (Lambert 1760, as summed over edges by
// Baum et al. 1989), seen from `position`, its directions bent by `bend`. wanted: false gives 0, soon. middle: the sum
// of these directions, as long as it comes.
float form_factor(Light light, vec3 position, mat3 bend, bool wanted, out vec3 middle) {
    vec3 centre = bend * (light.position - position);
    vec3 w = bend * light.half_width, h = bend * light.half_height;
    vec3 leaves = vec3(0), returns = vec3(0), a = centre - w - h;
    middle = vec3(0);
    bool cut = false;
    int i = wanted ? 0 : 4;
    do {
        bool side = i < 4;     // the last edge closes what the horizon cuts
        vec3 b = side ? centre + (i < 2 ? w : -w) + (i == 1 || i == 2 ? h : -h) : returns;
        a = side ? a : leaves;
        vec3 crossing = mix(a, b, clamp(a.z / (abs(a.z - b.z) > 1e-9 ? a.z - b.z : 1e-9), 0.0, 1.0));
        bool down = side && a.z > 0.0 && b.z <= 0.0, up = side && a.z <= 0.0 && b.z > 0.0;
        leaves = down ? crossing : leaves;
        returns = up ? crossing : returns;
        cut = cut || down;
        vec3 p = up ? crossing : a, q = down ? crossing : b;
        float unit = inversesqrt(max(dot(p, p) * dot(q, q), 1e-30)), cosine = dot(p, q) * unit;
        vec3 across = cross(p, q) * unit;
        float ratio = arc(min(abs(cosine), 1.0));
        ratio = cosine < 0.0 ? PI * inversesqrt(max(dot(across, across), 1e-14)) - ratio : ratio;
        bool counts = side ? max(a.z, b.z) > 0.0 : cut;
        middle += counts ? across * ratio : vec3(0);
        a = b;
    } while (++i < 4 || i == 4 && cut);
    middle *= middle.z < 0.0 ? -1.0 : 1.0;
    return middle.z * (0.5 / PI);
}

float form_factor(Light light, vec3 position, mat3 bend, bool wanted) {
    vec3 middle;
    return form_factor(light, position, bend, wanted, middle);
}

// Leaves directions as they are, n being z.
mat3 upright(vec3 n) {
    vec3 aside = normalize(cross(n, abs(n.x) < 0.7 ? vec3(1, 0, 0) : vec3(0, 1, 0)));
    return transpose(mat3(aside, cross(n, aside), n));
}

// The other way round in z.
mat3 flipped(mat3 bend) { return mat3(1, 0, 0, 0, 1, 0, 0, 0, -1) * bend; }
