#version 430 core
// Radiance of one pixel from its samples. A pixel whose samples lie on one plane of one object is lit once
// with their mean (light is linear in albedo; the spread of the normals widens the highlight); any other
// pixel is lit sample by sample. Output: the frame at its final size.
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

const int MAX_SAMPLES = 16;
const float PLANE_TOLERANCE = 0.002;  // of the distance

struct Point {
    Sample surface;
    vec3 position;
    vec3 normal;       // mean, its length tells the spread
};

Point point_at(ivec2 pixel, int i) {
    ivec2 cell = ivec2(i % grid, i / grid);
    ivec2 texel = pixel * grid + cell;
    Point p;
    p.surface = unpack_sample(texelFetch(samples_a, texel, 0), texelFetch(samples_b, texel, 0).xy);
    if (texelFetch(window_depth, texel, 0).r >= 1.0) p.surface.object_id = -1;
    vec2 ndc = (vec2(pixel) + (vec2(cell) + 0.5) / float(grid) - shift) / vec2(size) * 2.0 - 1.0;
    vec3 local = vec3(ndc.x / focal.x, -ndc.y / focal.y, 1.0) * p.surface.depth;
    p.position = local * axes + origin;
    p.normal = p.surface.normal;
    return p;
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
    Sample s = p.surface;
    vec3 v = normalize(origin - p.position);
    vec3 n = normalize(p.normal);
    vec3 f0 = mix(vec3(s.specular), s.albedo, s.metallic);
    float nv = max(abs(dot(n, v)), 1e-3);
    vec3 diffuse = s.albedo * ((1.0 - s.metallic) * (1.0 - s.specular) / 3.14159265);
    vec3 sum = vec3(0);
    for (int i = 0; i < light_count; ++i) {
        Light light = lights[i];
        vec3 to_light = light.position.xyz - p.position;
        float distance_m = length(to_light);
        vec3 l = to_light / distance_m;
        vec3 arrives = arriving(light, l, distance_m) * smoothstep(-0.15, 0.0, dot(s.face_normal, l));
        float angular = light.position.w / max(distance_m, light.position.w);
        float alpha = min(sqrt(s.alpha * s.alpha + 0.25 * angular * angular), 1.0);
        if (dot(p.normal, l) > 0.0 && max(arrives.r, max(arrives.g, arrives.b)) > 0.0) {
            vec3 f = diffuse * dot(p.normal, l) + reflected(f0, alpha, n, v, l);
            sum += f * arrives * visibility(light, p.position, s.face_normal);
        }
    }
    float open = openness(pixel, s.depth);
    vec2 share = mirror_share(sqrt(s.alpha), nv);
    vec3 ambient = ambient_light(n) * s.albedo * ((1.0 - s.metallic) * (1.0 - s.specular));
    vec3 mirror = (f0 * share.x + min(share.y, 50.0 * f0.g)) * mirrored(p.position, reflect(-v, n), s.alpha);
    return sum + open * (ambient + mirror);
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    int count = grid * grid;
    int middle = (grid / 2) * grid + grid / 2;
    Point first = point_at(pixel, middle);
    Point mean = first;
    mean.surface.albedo = vec3(0);
    mean.surface.alpha = mean.surface.metallic = mean.surface.specular = 0.0;
    mean.position = mean.normal = vec3(0);
    bool flat_ = true;
    for (int i = 0; i < count; ++i) {
        Point p = point_at(pixel, i);
        if (p.surface.object_id < 0) { flat_ = false; continue; }
        mean.surface.albedo += p.surface.albedo;
        mean.surface.alpha += p.surface.alpha * p.surface.alpha;
        mean.surface.metallic += p.surface.metallic;
        mean.surface.specular += p.surface.specular;
        mean.position += p.position;
        mean.normal += p.normal;
        flat_ = flat_ && p.surface.object_id == first.surface.object_id
            && dot(p.surface.face_normal, first.surface.face_normal) > 0.99
            && abs(dot(p.position - first.position, first.surface.face_normal)) < PLANE_TOLERANCE * first.surface.depth;
    }
    float share = 1.0 / float(count);
    mean.surface.albedo *= share;
    mean.normal *= share;
    float spread = 1.0 - min(length(mean.normal), 1.0);
    flat_ = flat_ && spread < 0.05;

    vec3 sum = vec3(0);
    int rounds = flat_ ? 1 : count;
    for (int i = 0; i < rounds; ++i) {
        Point p;
        if (flat_) {
            p = mean;
            p.surface.alpha = sqrt(min(p.surface.alpha * share + 2.0 * spread, 1.0));
            p.surface.metallic *= share;
            p.surface.specular *= share;
            p.position *= share;
        } else {
            p = point_at(pixel, i);
        }
        if (p.surface.object_id >= 0) sum += radiance(p, pixel);
    }
    bool hit = first.surface.object_id >= 0;
    out_radiance = vec4(sum / float(rounds), hit ? first.surface.depth : 0.0);
    out_albedo = vec4(mean.surface.albedo, hit ? float(first.surface.object_id) : 0.0);
    out_normal = vec4(hit ? axes * first.surface.normal * vec3(1, 1, -1) : vec3(0, 0, 1), 0.0);
}
