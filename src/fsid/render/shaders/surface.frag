#version 430 core
// Material evaluation: box mapping in metres, blended where the surface turns from one axis to the next.
#include "encoding.glsl"
in vec3 metric;
in vec3 metric_normal;
in vec3 from_camera;
in float distance_m;
flat in vec4 place[3];
flat in vec4 colour_a, colour_b, colour_c, maps, scale;
layout(binding = 0) uniform sampler2DArray masks;    // mix, pattern, detail, roughness
layout(binding = 1) uniform sampler2DArray relief;   // slope u, slope v, spread, metallic
layout(location = 0) out uvec4 out_a;
layout(location = 1) out uvec2 out_b;

const float BLEND = 0.2;          // axes whose component is this close to the largest one are blended
const float MIN_ROUGHNESS = 0.18; // bounds the highlight: alpha >= 0.032
const float MAX_WIDENING = 0.18;  // of alpha^2 by screen-space curvature (Tokuyoshi and Kaplanyan 2019)
const float MAX_PROBES = 4.0;
const float SLOPE_LEVELS = 127.0;
const float DETAIL = 2.0 * 255.0 / 254.0;  // neutral detail is stored exactly

vec3 turn(vec3 v) { return vec3(dot(place[0].xyz, v), dot(place[1].xyz, v), dot(place[2].xyz, v)); }

// Directions in which the texture's u and v grow on the faces of a box; v grows downwards.
void face_axes(int axis, float side, out vec3 u, out vec3 v) {
    u = axis == 0 ? vec3(0, side, 0) : axis == 1 ? vec3(-side, 0, 0) : vec3(1, 0, 0);
    v = axis == 2 ? vec3(0, -side, 0) : vec3(0, 0, -1);
}

void main() {
    vec3 face = cross(dFdx(from_camera), dFdy(from_camera));
    vec3 dx = dFdx(metric), dy = dFdy(metric);
    vec3 n = normalize(metric_normal);

    vec3 size = abs(n);
    vec3 weight = max(size - (max(size.x, max(size.y, size.z)) - BLEND), 0.0);
    weight *= weight;
    weight /= weight.x + weight.y + weight.z;
    vec4 mask = vec4(0), other = vec4(0);
    vec3 gradient = vec3(0);
    float total = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
        if (weight[axis] <= 1e-3) continue;
        vec3 u, v;
        face_axes(axis, n[axis] < 0.0 ? -1.0 : 1.0, u, v);
        vec3 tu = colour_a.w * u + colour_b.w * v;
        vec3 tv = colour_a.w * v - colour_b.w * u;
        vec2 uv = vec2(dot(tu, metric), dot(tv, metric)) * scale.w + vec2(0.37, 0.61) * float(axis);
        vec2 gx = vec2(dot(tu, dx), dot(tv, dx)) * scale.w;
        vec2 gy = vec2(dot(tu, dy), dot(tv, dy)) * scale.w;
        // Long footprints are covered by several probes along their length: written out, because drivers
        // differ in their anisotropic filter (and some take seconds for one frame of it).
        float lx = dot(gx, gx), ly = dot(gy, gy);
        vec2 along = lx > ly ? gx : gy;
        float across2 = max(min(lx, ly), 1e-16);
        int probes = int(clamp(ceil(sqrt(max(lx, ly) / across2) - 0.5), 1.0, MAX_PROBES));
        float level = log2(sqrt(max(lx, ly)) / float(probes) * float(textureSize(masks, 0).x));
        vec4 m = vec4(0), r = vec4(0);
        for (int k = 0; k < probes; ++k) {
            vec3 probe = vec3(uv + along * ((float(k) + 0.5) / float(probes) - 0.5), maps.x);
            m += textureLod(masks, probe, level);
            r += textureLod(relief, probe, level);
        }
        m /= float(probes);
        r /= float(probes);
        vec2 slope = (r.xy * 255.0 - 128.0) / SLOPE_LEVELS * maps.y;
        mask += weight[axis] * m;
        other += weight[axis] * r;
        gradient += weight[axis] * (slope.x * tu + slope.y * tv);
        total += weight[axis];
    }
    mask /= total;
    other /= total;
    gradient /= total;

    vec3 bumped = normalize(n - (gradient - n * dot(n, gradient)));
    vec3 normal = turn(bumped);
    vec3 smooth_normal = turn(n);
    face = dot(face, face) > 0.0 ? normalize(face) : smooth_normal;
    if (dot(face, from_camera) > 0.0) face = -face;
    if (dot(smooth_normal, face) < 0.0) normal = -normal;

    float roughness = clamp(mask.a * colour_c.w, MIN_ROUGHNESS, 1.0);
    float spread = other.b * maps.y;
    vec3 nx = dFdx(bumped), ny = dFdy(bumped);
    float curvature = min(0.5 * (dot(nx, nx) + dot(ny, ny)), MAX_WIDENING);
    float alpha2 = roughness * roughness * roughness * roughness + 2.0 * spread * spread + curvature;

    vec3 base = mix(mix(colour_a.rgb, colour_b.rgb, mask.r), colour_c.rgb, mask.g);
    Sample result;
    result.albedo = clamp(base * (mask.b * DETAIL), 0.0, 1.0);
    result.normal = normal;
    result.face_normal = face;
    result.alpha = sqrt(min(alpha2, 1.0));
    result.metallic = other.a;
    result.specular = maps.z;
    result.depth = distance_m;
    result.object_id = floatBitsToInt(maps.w);
    pack_sample(result, out_a, out_b);
}
