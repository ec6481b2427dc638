#version 430 core
// Radiance of one pixel from its samples. Samples that lie on one plane of one object are lit once, with their
// mean: light is linear in the colours, and the spread of the normals widens the highlight. A pixel inside
// a surface is one such group, one at an edge two or three. Output: the frame at its final size.
#include "encoding.glsl"
#include "lights.glsl"
#include "room.glsl"
layout(binding = 0) uniform usampler2D samples_a;
layout(binding = 1) uniform usampler2D samples_b;
layout(binding = 5) uniform sampler2D window_depth;
layout(binding = 6) uniform sampler2D occlusion;
uniform int grid;
uniform ivec2 size;
uniform vec2 focal;
uniform vec2 shift;       // of the image, in pixels
uniform mat3 axes;        // rows right, up, forward
uniform vec3 origin;
layout(location = 0) out vec4 out_radiance;   // a: depth in metres, 0 where nothing was hit
layout(location = 1) out vec4 out_albedo;     // a: object id + 1
layout(location = 2) out vec4 out_normal;     // camera space

const float PLANE_TOLERANCE = 0.002;  // of the distance
const float MIN_FACE_COSINE = 0.97;
const float MIN_NORMAL_COSINE = 0.85;

struct Point {
    vec3 position;
    vec3 normal;         // of a group the mean: its length tells the spread
    vec3 face_normal;
    vec3 diffuse, f0;    // albedo of the diffuse part, reflectance at normal incidence
    float alpha2;
    float depth;
    int object_id;       // one more than in the frame, -1 where nothing was hit
};

Sample sample_at(ivec2 texel) {
    Sample s = unpack_sample(texelFetch(samples_a, texel, 0), texelFetch(samples_b, texel, 0).xy);
    if (texelFetch(window_depth, texel, 0).r >= 1.0) s.object_id = -1;
    return s;
}

Point point_at(ivec2 pixel, int i, out vec3 albedo) {
    ivec2 cell = ivec2(i % grid, i / grid);
    Sample s = sample_at(pixel * grid + cell);
    albedo = s.object_id < 0 ? vec3(0) : s.albedo;
    vec2 ndc = (vec2(pixel) + (vec2(cell) + 0.5) / float(grid) - shift) / vec2(size) * 2.0 - 1.0;
    vec3 local = vec3(ndc.x / focal.x, -ndc.y / focal.y, 1.0) * s.depth;
    return Point(local * axes + origin, s.normal, s.face_normal,
                 s.albedo * ((1.0 - s.metallic) * (1.0 - s.specular)),
                 mix(vec3(s.specular), s.albedo, s.metallic), s.alpha * s.alpha, s.depth, s.object_id);
}

bool alike(Point a, Point b) {
    return a.object_id == b.object_id && dot(a.face_normal, b.face_normal) > MIN_FACE_COSINE
        && dot(a.normal, b.normal) > MIN_NORMAL_COSINE
        && abs(dot(a.position - b.position, a.face_normal)) < PLANE_TOLERANCE * a.depth;
}

// The samples still `open` that are like the first of them, as one point; they are taken out of `open`.
Point next_group(ivec2 pixel, inout uint open, out float members, inout vec3 albedo) {
    vec3 sample_albedo;
    Point first = point_at(pixel, findLSB(open), sample_albedo);
    Point mean = first;
    mean.position = mean.normal = mean.diffuse = mean.f0 = vec3(0);
    mean.alpha2 = members = 0.0;
    for (int i = 0; i < grid * grid; ++i) {
        Point p = point_at(pixel, i, sample_albedo);
        if ((open & (1u << i)) != 0u && alike(first, p)) {
            open &= ~(1u << i);
            members += 1.0;
            albedo += sample_albedo;
            mean.position += p.position;
            mean.normal += p.normal;
            mean.diffuse += p.diffuse;
            mean.f0 += p.f0;
            mean.alpha2 += p.alpha2;
        }
    }
    if (members == 0.0) {           // not even like itself: not a number
        open &= open - 1u;
        mean.object_id = -1;
        members = 1.0;
    }
    float share = 1.0 / members;
    mean.position *= share;
    mean.normal *= share;
    mean.diffuse *= share;
    mean.f0 *= share;
    mean.alpha2 = min(mean.alpha2 * share + 2.0 * (1.0 - min(length(mean.normal), 1.0)), 1.0);
    return mean;
}

// Openness of the nearest-depth neighbours: the blur of the fixed tap pattern stops at edges.
float openness(ivec2 pixel, float depth) {
    float sum = 0.0, total = 0.0;
    for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
            vec2 o = texelFetch(occlusion, clamp(pixel + ivec2(x, y), ivec2(0), size - 1), 0).xy;
            float d = (o.y - depth) / (0.02 * depth);
            float w = 1.0 / (1e-3 + d * d);
            sum += w * o.x;
            total += w;
        }
    }
    return sum / total;
}

vec3 radiance(Point p, ivec2 pixel) {
    vec3 v = normalize(origin - p.position);
    vec3 n = normalize(p.normal);
    float alpha = sqrt(p.alpha2);
    vec2 share = mirror_share(sqrt(alpha), max(abs(dot(n, v)), 1e-3));
    // What one bounce between microfacets loses, given back (Turquin 2019).
    vec3 rebound = 1.0 + p.f0 * (1.0 / max(share.x + share.y, 0.1) - 1.0);
    vec3 sum = vec3(0);
    for (int i = 0; i < light_count; ++i) {
        Light light = lights[i];
        vec3 to_light = light.position.xyz - p.position;
        float distance_m = length(to_light);
        vec3 l = to_light / distance_m;
        vec3 arrives = arriving(light, l, distance_m) * smoothstep(-0.15, 0.0, dot(p.face_normal, l));
        float nl = dot(p.normal, l);
        if (nl > 0.0 && max(arrives.r, max(arrives.g, arrives.b)) > 0.0) {
            float angular = light.position.w / max(distance_m, light.position.w);
            float wide = min(sqrt(p.alpha2 + 0.25 * angular * angular), 1.0);
            vec3 f = p.diffuse * (nl / 3.14159265) + rebound * reflected(p.f0, wide, n, v, l);
            sum += f * arrives * visibility(light, p.position, p.face_normal);
        }
    }
    vec3 mirror = p.f0 * share.x + min(share.y, 50.0 * max(p.f0.r, max(p.f0.g, p.f0.b)));
    vec3 surroundings = cube(ambient_sides, n) * p.diffuse + rebound * mirror * mirrored(p.position, reflect(-v, n), alpha);
    return sum + openness(pixel, p.depth) * surroundings;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int count = grid * grid;
    uint open = (1u << count) - 1u;
    vec3 sum = vec3(0), albedo = vec3(0);
    while (open != 0u) {
        float members;
        Point p = next_group(pixel, open, members, albedo);
        if (p.object_id >= 0) sum += members * radiance(p, pixel);
    }
    Sample middle = sample_at(pixel * grid + grid / 2);
    bool hit = middle.object_id >= 0;
    out_radiance = vec4(sum / float(count), hit ? middle.depth : 0.0);
    out_albedo = vec4(albedo / float(count), hit ? float(middle.object_id) : 0.0);
    out_normal = vec4(hit ? axes * middle.normal * vec3(1, 1, -1) : vec3(0, 0, 1), 0.0);
}
