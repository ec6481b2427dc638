#version 430 core
// Radiance of one pixel from its samples. Samples that lie on one plane of one surface are shaded once, at their
// mean: the spread of their normals widens the highlight, and textures are filtered over the pixel. A pixel
// inside a surface is one such group, one at an edge two or three. Output: the frame at its final size.
#include "encoding.glsl"
#include "surfaces.glsl"
#include "material.glsl"
#include "lights.glsl"
#include "room.glsl"
#include "lens.glsl"
layout(binding = 8) uniform usampler2D samples;
layout(binding = 9) uniform sampler2D occlusion;
layout(binding = 10) uniform sampler2D sky;   // equirectangular
uniform float sky_level;  // mip level at which a texel of the sky is a pixel; -1 without sky
uniform vec3 vignetting;
uniform mat3 axes;        // rows right, up, forward
uniform vec3 origin;
layout(location = 0) out vec4 out_radiance;   // a: depth in metres, 0 where nothing was hit
layout(location = 1) out vec4 out_albedo;     // a: (object id + 1) / 65535
layout(location = 2) out vec4 out_normal;     // camera space, 0.5 + 0.5 n

const float PLANE_TOLERANCE = 0.002;  // of the distance
const float MIN_FACE_COSINE = 0.97;
const float MIN_NORMAL_COSINE = 0.85;

struct Sample {
    vec3 position;
    vec3 normal, face_normal;
    float depth;
    int surface;         // -1: nothing was hit
};

Sample sample_at(vec2 at) {
    vec3 ray = ray_at(at);
    uvec4 code = texelFetch(samples, clamp(ivec2(seen_at(ray) * float(grid)), ivec2(0), seen * grid - 1), 0);
    float depth = uintBitsToFloat(code.w);
    return Sample(ray * depth * axes + origin, unpack_direction(code.x), unpack_direction(code.y), depth,
                  int(code.z) - 1);
}

vec2 place_of(ivec2 pixel, int i) { return vec2(pixel) + (vec2(i % grid, i / grid) + 0.5) / float(grid); }

bool alike(Sample a, Sample b) {
    return a.surface == b.surface && dot(a.face_normal, b.face_normal) > MIN_FACE_COSINE
        && dot(a.normal, b.normal) > MIN_NORMAL_COSINE
        && abs(dot(a.position - b.position, a.face_normal)) < PLANE_TOLERANCE * a.depth;
}

// The samples still `open` that are like the first of them, as one; they are taken out of `open`. Its normal
// is the mean: its length tells the spread.
Sample next_group(ivec2 pixel, inout uint open, out float members) {
    int lowest = findLSB(open);
    Sample first = sample_at(place_of(pixel, lowest));
    Sample mean = first;
    members = 1.0;
    open &= open - 1u;
    for (int i = lowest + 1; i < grid * grid; ++i) {
        Sample s = sample_at(place_of(pixel, i));
        bool joins = (open & (1u << i)) != 0u && alike(first, s);
        float one = joins ? 1.0 : 0.0;
        open &= joins ? ~(1u << i) : ~0u;
        members += one;
        mean.position += one * (s.position - first.position);
        mean.normal += one * s.normal;
    }
    mean.position = first.position + (mean.position - first.position) / members;
    mean.normal /= members;
    return mean;
}

// Openness of the blocks around that lie at this depth: the blur of the fixed tap pattern stops at edges.
float openness(vec3 position, float depth) {
    vec3 local = axes * (position - origin);
    vec2 at = seen_at(local / local.z) * 0.5 - 0.5;
    ivec2 corner = ivec2(floor(at));
    vec2 f = at - vec2(corner);
    ivec2 last = textureSize(occlusion, 0) - 1;
    float sum = 0.0, total = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 cell = ivec2(i & 1, i >> 1);
        vec2 o = texelFetch(occlusion, clamp(corner + cell, ivec2(0), last), 0).xy;
        float d = (o.y - depth) / (0.02 * depth);
        vec2 near = mix(1.0 - f, f, vec2(cell));
        float w = (near.x * near.y + 1e-3) / (1e-3 + d * d);
        sum += w * o.x;
        total += w;
    }
    return sum / total;
}

vec3 radiance(Sample p, Surface s, Matter m, float spread) {
    vec3 v = normalize(origin - p.position);
    vec3 n = normalize(m.normal);
    float alpha2 = min(m.alpha2 + 2.0 * spread, 1.0), alpha = sqrt(alpha2);
    vec3 diffuse = m.albedo * ((1.0 - m.metallic) * (1.0 - s.specular));
    vec3 f0 = mix(vec3(s.specular), m.albedo, m.metallic);
    vec2 share = mirror_share(sqrt(alpha), max(abs(dot(n, v)), 1e-3));
    // What one bounce between microfacets loses, given back (Turquin 2019).
    vec3 rebound = 1.0 + f0 * (1.0 / max(share.x + share.y, 0.1) - 1.0);
    vec3 mirror = f0 * share.x + min(share.y, 50.0 * max(f0.r, max(f0.g, f0.b)));
    vec3 r = reflect(-v, n);
    vec3 sum = vec3(0);
    for (int i = 0; i < light_count; ++i) {
        Light light = light_at(i);
        bool area = light.kind == AREA;
        vec3 to_light = light.kind == SUN ? -light.direction : light.position - p.position;
        float distance_m = length(to_light);
        vec3 l = to_light / distance_m;
        float ahead = dot(p.face_normal, l);
        float nl = dot(n, l);
        float angular = light.kind == SUN ? light.radius_m : light.radius_m / max(distance_m, light.radius_m);
        float wide = min(sqrt(alpha2 + 0.25 * angular * angular), 1.0);
        vec3 arrives = arriving(light, l, distance_m) * smoothstep(-0.15, 0.0, ahead);
        vec3 direct = (diffuse * (max(nl, 0.0) / PI) + rebound * reflected(f0, wide, n, v, l)) * arrives;
        if (area) {
            bool faces = dot(to_light, light.direction) < 0.0;
            direct = faces ? light.colour * (diffuse * form_factor(light, p.position, n, 5)
                                             + rebound * mirror * mirror_form(light, p.position, r, alpha)) : vec3(0);
        }
        bool wanted = max(direct.r, max(direct.g, direct.b)) > 0.0;
        sum += direct * visibility(light, p.position, p.face_normal, wanted);
    }
    vec3 surroundings = cube(ambient_sides, n) * diffuse + rebound * mirror * mirrored(p.position, r, alpha);
    return sum + openness(p.position, p.depth) * surroundings;
}

vec3 sky_at(vec3 direction) {
    vec3 d = normalize(direction);
    vec2 uv = vec2(atan(d.y, d.x) / (2.0 * PI), acos(clamp(d.z, -1.0, 1.0)) / PI);
    return sky_level < 0.0 ? vec3(0) : textureLod(sky, uv, sky_level).rgb;
}

// How the position moves on the plane of the face to the next pixel in direction of `step`.
vec3 moves(Sample p, vec3 ray, vec3 step) {
    float facing = dot(p.face_normal, ray);
    float limited = facing < 0.0 ? min(facing, -0.02) : max(facing, 0.02);
    return p.depth * (step - ray * (dot(p.face_normal, step) / limited));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 local = ray_at(vec2(pixel) + 0.5);
    vec3 ray = local * axes;
    vec3 right = (ray_at(vec2(pixel) + vec2(1.5, 0.5)) - local) * axes;
    vec3 down = (ray_at(vec2(pixel) + vec2(0.5, 1.5)) - local) * axes;
    int count = grid * grid, middle = (grid / 2) * (grid + 1);
    uint open = (1u << count) - 1u;
    vec3 sum = vec3(0), albedo = vec3(0), relief = vec3(0);
    int id = 0;
    while (open != 0u) {
        uint before = open;
        float members;
        Sample p = next_group(pixel, open, members);
        bool hit = p.surface >= 0;
        Surface s = surface_at(max(p.surface, 0));
        float spread = 1.0 - min(length(p.normal), 1.0);
        vec3 smooth_normal = normalize(p.normal);
        Matter m = matter_at(s, p.position, smooth_normal, moves(p, ray, right), moves(p, ray, down));
        bool front = dot(smooth_normal, p.face_normal) > 0.0;
        vec3 turned = front ? smooth_normal : -smooth_normal;
        m.normal = front ? m.normal : -m.normal;
        vec3 light = radiance(p, s, m, spread);
        light += s.emission * m.albedo + (front ? s.glow : vec3(0));
        sum += members * (hit ? light : sky_at(ray));
        albedo += hit ? members * m.albedo : vec3(0);
        bool labels = ((before & ~open) & (1u << middle)) != 0u && hit;
        relief = labels ? m.normal - turned : relief;
        id = labels ? s.object_id : id;
    }
    Sample label = sample_at(place_of(pixel, middle));
    vec2 corner = (vec2(pixel) + 0.5) / vec2(size) * 2.0 - 1.0;
    float r2 = dot(corner, corner * vec2(size * size)) / dot(vec2(size), vec2(size));
    float gain = max(1.0 + r2 * (vignetting.x + r2 * (vignetting.y + r2 * vignetting.z)), 0.0);
    out_radiance = vec4(sum * (gain / float(count)), label.surface >= 0 ? label.depth : 0.0);
    out_albedo = vec4(albedo / float(count), float(id) / 65535.0);
    vec3 normal = dot(label.normal, label.face_normal) < 0.0 ? -label.normal : label.normal;
    normal = axes * normalize(normal + relief) * vec3(1, 1, -1);
    out_normal = vec4(0.5 + 0.5 * (label.surface >= 0 ? normal : vec3(0, 0, 1)), 0.0);
}
