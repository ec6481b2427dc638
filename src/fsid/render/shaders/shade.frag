#version 430 core
// Radiance of one pixel from its samples. Samples that lie on one plane of one surface are shaded once, at their
// mean: the spread of their normals widens the highlight, and textures are filtered over the pixel. A pixel
// inside a surface is one such group, one at an edge two or three. Output: the frame at its final size.
// LOBES: 1 with clearcoat, sheen and translucency. GLASS: 1 in the second pass, whose samples are glass alone and
// which looks what is behind up in the result of the first.
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
#if GLASS
layout(binding = 11) uniform sampler2D behind;          // as out_radiance
layout(binding = 12) uniform sampler2D behind_albedo;   // as out_albedo
layout(binding = 13) uniform sampler2D behind_normal;   // as out_normal
#endif
uniform mat3 axes;        // rows right, up, forward
uniform vec3 origin;
layout(location = 0) out vec4 out_radiance;   // a: depth in metres, 0 where nothing was hit
layout(location = 1) out vec4 out_albedo;     // a: (object id + 1) / 65535
layout(location = 2) out vec4 out_normal;     // camera space, 0.5 + 0.5 n

const float PLANE_TOLERANCE = 0.002;  // of the distance
const float MIN_FACE_COSINE = 0.97;
const float MIN_NORMAL_COSINE = 0.85;
const float COAT_F0 = 0.04;   // index 1.5

struct Sample {
    vec3 position;
    vec3 normal, face_normal;
    float depth;
    int surface;         // -1: nothing was hit
};

Sample sample_at(vec2 at) {
    vec3 ray = ray_at(at);
    ivec2 texel = clamp(ivec2(seen_at(ray) * float(grid)), ivec2(0), seen * grid - 1);
    uvec4 code = texelFetch(samples, texel, 0);
    vec3 face_normal = unpack_direction(code.y);
    float depth = uintBitsToFloat(code.w);
#if LENS > 0
    // This ray meets the plane that the nearest ray of the pinhole image has met.
    vec3 facing = axes * face_normal;
    depth *= clamp(dot(facing, seen_ray((vec2(texel) + 0.5) / float(grid))) / dot(facing, ray), 0.9, 1.1);
#endif
    return Sample(ray * depth * axes + origin, unpack_direction(code.x), face_normal, depth, int(code.z) - 1);
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

#if LOBES
// Cloth's fuzz of roughness 0.5 (Estevez and Kulla 2017) with the visibility of Neubelt and Pettineo (2013); f * cos.
float fuzz(vec3 n, vec3 v, vec3 l) {
    float nl = max(dot(n, l), 0.0), nv = max(abs(dot(n, v)), 1e-3), nh = dot(n, normalize(v + l));
    return (2.0 / PI) * max(1.0 - nh * nh, 0.0) * nl / (4.0 * max(nl + nv - nl * nv, 1e-3));
}

// Share of light that it reflects: the integral of `fuzz`, fitted to 0.004.
float fuzz_share(float nv) {
    float r = sqrt(nv);
    return 0.787036 + r * (-0.717702 + r * (-0.122279 + r * 0.137787));
}
#endif

#if GLASS
// What is seen through a slab of glass (index 1.5): the ray is moved sideways and goes on as before.
vec3 seen_through(Sample p, Surface s, vec3 n, vec3 v) {
    vec3 inside = refract(-v, n, 1.0 / 1.5);
    float thick = s.thickness_m / max(-dot(inside, n), 0.3);
    vec3 local = axes * (p.position - origin);
    vec2 here = pixel_of(local);
    float beyond = texture(behind, here / vec2(size)).a;
    float left = max(beyond > 0.0 ? beyond - local.z : 10.0, 0.0) / max(dot(axes[2], -v), 0.1);
    vec2 there = pixel_of(axes * (p.position + inside * thick - v * left - origin));
    vec4 moved = texture(behind, clamp(there / vec2(size), 0.5 / vec2(size), 1.0 - 0.5 / vec2(size)));
    bool hidden = moved.a > 0.0 && moved.a < local.z;
    return hidden ? texture(behind, here / vec2(size)).rgb : moved.rgb;
}
#endif

vec3 radiance(Sample p, Surface s, Matter m, float spread) {
    vec3 v = normalize(origin - p.position);
    vec3 n = normalize(m.normal);
    float alpha2 = min(m.alpha2 + 2.0 * spread, 1.0), alpha = sqrt(alpha2);
    vec3 diffuse = m.albedo * ((1.0 - m.metallic) * (1.0 - s.specular));
    float nv = max(abs(dot(n, v)), 1e-3);
#if GLASS
    diffuse *= 1.0 - s.transmission;
#endif
#if LOBES
    // The layers above take their share of what arrives at those below.
    vec2 coat_share = mirror_share(sqrt(s.clearcoat_alpha), nv);
    float coat = s.clearcoat * (COAT_F0 * coat_share.x + coat_share.y);
    float cloth = s.sheen * fuzz_share(nv);
    float below = (1.0 - coat) * (1.0 - cloth);
    vec3 through = diffuse * s.translucency * below;
    diffuse *= 1.0 - s.translucency;
#endif
    vec3 f0 = mix(vec3(s.specular), m.albedo, m.metallic);
    vec2 share = mirror_share(sqrt(alpha), nv);
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
#if LOBES
        float coat_wide = min(sqrt(s.clearcoat_alpha * s.clearcoat_alpha + 0.25 * angular * angular), 1.0);
        float coated = s.clearcoat * (1.0 - cloth);
        vec3 layers = (coated * reflected(vec3(COAT_F0), coat_wide, n, v, l) + s.sheen * fuzz(n, v, l)) * arrives;
        if (area) {
            bool faces = dot(to_light, light.direction) < 0.0;
            float mirror_part = coat * (1.0 - cloth) * mirror_form(light, p.position, r, s.clearcoat_alpha);
            layers = faces ? light.colour * (mirror_part + cloth * form_factor(light, p.position, n, 5)) : vec3(0);
        }
        direct = direct * below + layers;
        direct += through * (area ? light.colour * form_factor(light, p.position, -n, dot(to_light, light.direction) < 0.0 ? 5 : 0)
                                  : arriving(light, l, distance_m) * (smoothstep(-0.15, 0.0, -ahead) * max(-nl, 0.0) / PI));
#endif
        bool wanted = max(direct.r, max(direct.g, direct.b)) > 0.0;
        sum += direct * visibility(light, p.position, p.face_normal, wanted);
    }
    vec3 surroundings = cube(ambient_sides, n) * diffuse + rebound * mirror * mirrored(p.position, r, alpha);
#if LOBES
    surroundings = surroundings * below + coat * (1.0 - cloth) * mirrored(p.position, r, s.clearcoat_alpha)
                 + cloth * cube(ambient_sides, n) + through * cube(ambient_sides, -n);
#endif
    vec3 result = sum + openness(p.position, p.depth) * surroundings;
#if GLASS
    float passes = s.transmission * (1.0 - m.metallic) * (1.0 - mirror.g) * (1.0 - mirror.g);
    result += passes * m.albedo * seen_through(p, s, n, v);
#endif
    return result;
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
#if GLASS
    // Where there is no glass nothing is shaded: loops over no samples and no lights are left at once.
    for (int i = 0; i < count; ++i) open &= sample_at(place_of(pixel, i)).surface < 0 ? ~(1u << i) : ~0u;
#endif
    vec3 sum = vec3(0), albedo = vec3(0), relief = vec3(0);
    int id = 0;
    float covered = 0.0;
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
#if GLASS
        covered += hit ? members : 0.0;
        sum += hit ? members * light : vec3(0);
#else
        sum += members * (hit ? light : sky_at(ray));
#endif
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
#if GLASS
    float bare = 1.0 - covered / float(count);
    vec4 far = texelFetch(behind, pixel, 0), far_albedo = texelFetch(behind_albedo, pixel, 0);
    out_radiance.rgb += bare * far.rgb;
    out_albedo.rgb += bare * far_albedo.rgb;
    if (label.surface < 0) {
        out_radiance.a = far.a;
        out_albedo.a = far_albedo.a;
        out_normal = texelFetch(behind_normal, pixel, 0);
    }
#endif
}
