#version 430 core
// Radiance of one pixel from its samples. Samples that lie on one plane of one surface are shaded once, at their
// mean: the spread of their normals widens the highlight, and textures are filtered over the pixel. A pixel
// inside a surface is one such group, one at an edge two or three. Output: the frame at its final size.
// GRID: edge of the square of samples per pixel. LOBES: 1 with clearcoat, sheen and translucency. AREAS: 1 with
// area lights. GLASS: 1 in the second pass, whose samples are glass alone and which looks what is behind up in
// the result of the first. OWN: 0 leaves lights out whose shadow is not interpolated and marks the pixel, 1
// adds those lights alone, 2 is both at once. PLANAR: how many mirrors may have an image.
#include "screen.glsl"
#include "encoding.glsl"
#include "surfaces.glsl"
#include "material.glsl"
#include "lights.glsl"
#include "moments.glsl"
#include "shadows.glsl"
#include "room.glsl"
#include "lens.glsl"
#include "samples.glsl"
#include "blocks.glsl"
#include "reflector.glsl"
#if PLANAR
#include "planar.glsl"
#endif
layout(binding = 10) uniform sampler2D sky;   // equirectangular
uniform float sky_level;  // mip level at which a texel of the sky is a pixel; -1 without sky
uniform float sunless;    // what is brighter there is the sun, which is a light
uniform vec3 vignetting;
uniform float shining;    // 1; 0 in the image that a mirror shows, where lights have highlights instead

// Share of the light that the lens lets through to a place of the image, pixels.
float gain_at(vec2 place) {
    vec2 corner = place / vec2(size) * 2.0 - 1.0;
    float r2 = dot(corner, corner * vec2(size * size)) / dot(vec2(size), vec2(size));
    return max(1.0 + r2 * (vignetting.x + r2 * (vignetting.y + r2 * vignetting.z)), 0.0);
}
#if GLASS
layout(binding = 11) uniform sampler2D behind;          // as out_radiance
layout(binding = 12) uniform sampler2D behind_albedo;   // as out_albedo
layout(binding = 13) uniform sampler2D behind_normal;   // as out_normal
#endif
OUTPUT(0, rgba32f, out_radiance);   // a: depth in metres, 0 where nothing was hit
#if OWN != 1
OUTPUT(1, rgba16, out_albedo);     // a: (object id + 1) / 65535
OUTPUT(2, rgba16, out_normal);     // camera space, 0.5 + 0.5 n
#endif

const float LEFT_OUT = OWN == 0 ? 0.0 : 1.0;   // share of a light up to which it is not visited

// Light of all lights. First those whose shadow is interpolated; the others need their own, which costs much
// more, one after the other: lights differ from pixel to pixel in that loop, so that it is short. Where only
// these count (OWN 1 and 2) the first loop does no more than find them. Lights that a pixel does not need are left out
// of its loop, which is as long as that of the pixel beside it that needs most.
// missing: whether some were left out.
vec3 lights_on(Sample p, Reflector b, Blocks blocks, inout bool missing) {
    vec3 sum = vec3(0);
    int i = 0;
    do {
        int first = i;
        uint left = 0u;
        do {
            vec4 four = interpolated(blocks, i / 4);
            uint some = 0u;     // of these four lights
            for (int k = 0; k < 4; ++k) some |= i + k < light_count && four[k] > LEFT_OUT ? 1u << k : 0u;
#if OWN == 0
            do {
                int k = max(findLSB(some), 0);
                vec3 light = returned(light_at(i + k), p, b);
                bool wanted = some != 0u && max(light.r, max(light.g, light.b)) > 0.0;
                sum += wanted && four[k] <= 1.0 ? four[k] * light : vec3(0);
                left |= wanted && four[k] > 1.0 ? 1u << (i + k - first) : 0u;
                some &= some - 1u;
            } while (some != 0u);
#else
            left |= some << (i - first);
#endif
            i += 4;
        } while (i < min(light_count, first + 32));
        missing = missing || left != 0u;
#if OWN
        do {
            Light light = light_at(first + max(findLSB(left), 0));
            vec3 arrives = left != 0u ? returned(light, p, b) : vec3(0);
            bool even, wanted = max(arrives.r, max(arrives.g, arrives.b)) > 0.0;
            float lit = visibility(light, p.position, p.face_normal, wanted, 0.0, even);
            sum += wanted ? lit * arrives : vec3(0);
            left &= left - 1u;
        } while (left != 0u);
#endif
    } while (i < light_count);
    return sum;
}

#if GLASS
const float LEAST_GAIN = 1e-3;   // a lens that is darker shows nothing

// Depth in metres of what is behind at a place of the image, of one pixel: 0, where nothing was hit, is no depth to be
// blended with others.
float depth_behind(vec2 at) { return texelFetch(behind, clamp(ivec2(at), ivec2(0), size - 1), 0).a; }

// What is seen through a slab of glass (index 1.5): the ray is moved sideways and goes on as before.
vec3 seen_through(Sample p, Surface s, vec3 n, vec3 v) {
    vec3 inside = refract(-v, n, 1.0 / 1.5);
    float thick = s.thickness_m / max(-dot(inside, n), 0.3);
    vec3 local = axes * (p.position - origin);
    vec2 here = pixel_of(local);
    float beyond = depth_behind(here);
    float left = max(beyond > 0.0 ? beyond - local.z : 10.0, 0.0) / max(dot(axes[2], -v), 0.1);
    vec2 there = clamp(pixel_of(axes * (p.position + inside * thick - v * left - origin)), vec2(0.5), vec2(size) - 0.5);
    float met = depth_behind(there);
    vec2 at = met > 0.0 && met < local.z ? here : there;
    return texture(behind, at / vec2(size)).rgb / max(gain_at(at), LEAST_GAIN);   // which is in that image already
}
#endif

// What comes from direction r, averaged over a lobe of width alpha: the room's walls or the sky; on flat mirrors
// the things before them.
vec3 surroundings_in(Sample p, vec3 r, float alpha) {
    vec3 room = mirrored(p.position, r, alpha);
#if PLANAR
    room = with_mirrors(room, p, r, alpha);
#endif
    return room;
}

vec3 radiance(Sample p, Surface s, Matter m, float spread, inout bool missing) {
    Reflector b = reflector_of(p, s, m, spread);
    Blocks blocks = blocks_around(p);
    vec3 light = lights_on(p, b, blocks, missing);
#if OWN == 1
    return light;
#endif
#if LOBES
    vec3 in_body = vec3(0), in_coat = vec3(0);
    bool coat = false;
    do {    // once more where there is a coat: a branch would always run
        vec3 shown = surroundings_in(p, b.r, coat ? b.coat_alpha : b.alpha);
        in_body = coat ? in_body : shown;
        in_coat = coat ? shown : in_coat;
        coat = !coat;
    } while (coat && b.coat > 0.0);
    vec3 even = ambient_on(b.n);
    vec3 surroundings = (even * b.diffuse + b.mirror * in_body) * b.below + b.coat * in_coat
                      + b.cloth * even + b.through * ambient_on(-b.n);
#else
    vec3 surroundings = ambient_on(b.n) * b.diffuse + b.mirror * surroundings_in(p, b.r, b.alpha);
#endif
    vec3 result = light + openness(blocks, p.depth) * surroundings;
#if GLASS
    result += b.clear * seen_through(p, s, b.n, b.v);
#endif
    return result;
}

vec3 sky_at(vec3 direction) {
    vec3 d = normalize(direction);
    vec2 uv = vec2(atan(d.y, d.x) / (2.0 * PI), acos(clamp(d.z, -1.0, 1.0)) / PI);
    vec3 walls = (1.0 - shining) * mirrored(origin, d, 0.0);    // seen in a mirror where there are none
    vec3 seen_sky = textureLod(sky, uv, sky_level).rgb;
    return sky_level < 0.0 ? walls : mix(min(seen_sky, sunless), seen_sky, shining);
}

// How the position moves on the plane of the face to the next pixel in direction of `step`.
vec3 moves(Sample p, vec3 ray, vec3 step) {
    float facing = dot(p.face_normal, ray);
    float limited = facing < 0.0 ? min(facing, -0.02) : max(facing, 0.02);
    return p.depth * (step - ray * (dot(p.face_normal, step) / limited));
}

// A normal that is seen from v: relief and interpolation turn some away where nothing that is seen does. Those
// are mirrored, so that light does not jump where they begin to.
vec3 facing(vec3 n, vec3 v) { return n - 2.0 * min(dot(n, v), 0.0) * v; }

void main() {
    BEGIN(pixel);
    vec3 local = ray_at(vec2(pixel) + 0.5);
    vec3 ray = local * axes;
    vec3 right = (ray_at(vec2(pixel) + vec2(1.5, 0.5)) - local) * axes;
    vec3 down = (ray_at(vec2(pixel) + vec2(0.5, 1.5)) - local) * axes;
    uint open = (1u << COUNT) - 1u;
    Sample all[COUNT];
    for (int i = 0; i < COUNT; ++i) all[i] = sample_at(place_of(pixel, i));
#if GLASS
    for (int i = 0; i < COUNT; ++i) open &= all[i].surface < 0 ? ~(1u << i) : ~0u;
#endif
    vec3 sum = vec3(0), albedo = vec3(0), relief = vec3(0);
    int id = 0;
    bool missing = false;
    float covered = 0.0;
    do {
        uint before = open;
        float members;
        Sample p = next_group(all, open, members);
        bool hit = p.surface >= 0;
        Surface s = surface_at(max(p.surface, 0));
        float spread = 1.0 - min(length(p.normal), 1.0);
        vec3 smooth_normal = normalize(p.normal);
        Matter m = matter_at(s, p.position, smooth_normal, moves(p, ray, right), moves(p, ray, down));
        bool front = dot(smooth_normal, p.face_normal) > 0.0;
        vec3 turned = front ? smooth_normal : -smooth_normal;
        m.normal = facing(front ? m.normal : -m.normal, -normalize(ray));
        bool part = false;
        vec3 light = radiance(p, s, m, spread, part);
        missing = missing || part && hit;
        float shown = s.object_id == 0 ? 1.0 : shining;    // walls are no lights and have no highlights
        light += OWN == 1 ? vec3(0) : shown * s.emission * m.albedo + (front ? shining * s.glow : vec3(0));
#if GLASS
        covered += hit ? members : 0.0;
        sum += hit ? members * light : vec3(0);
#else
        sum += members * (hit ? light : OWN == 1 ? vec3(0) : sky_at(ray));
#endif
        albedo += hit ? members * m.albedo : vec3(0);
        bool labels = ((before & ~open) & (1u << MIDDLE)) != 0u && hit;
        relief = labels ? m.normal - turned : relief;
        id = labels ? s.object_id : id;
    } while (open != 0u);
    Sample label = all[MIDDLE];
    float gain = gain_at(vec2(pixel) + 0.5);
#if OWN == 1
    WRITE(out_radiance, pixel, vec4(sum * (gain / float(COUNT)), 0.0));
#else
    vec4 light = vec4(sum * (gain / float(COUNT)), label.surface >= 0 ? label.depth : 0.0);
    vec4 labels = vec4(albedo / float(COUNT), float(id) / 65535.0);
    vec3 normal = dot(label.normal, label.face_normal) < 0.0 ? -label.normal : label.normal;
    normal = axes * facing(normalize(normal + relief), -normalize(ray)) * vec3(1, 1, -1);
    vec4 faced = vec4(0.5 + 0.5 * (label.surface >= 0 ? normal : vec3(0, 0, 1)), 0.0);
#if GLASS
    float bare = 1.0 - covered / float(COUNT);
    vec4 far = texelFetch(behind, pixel, 0), far_albedo = texelFetch(behind_albedo, pixel, 0);
    light.rgb += bare * far.rgb;
    labels.rgb += bare * far_albedo.rgb;
    if (label.surface < 0) {
        light.a = far.a;
        labels.a = far_albedo.a;
        faced = texelFetch(behind_normal, pixel, 0);
    }
#endif
    WRITE(out_radiance, pixel, light);
    WRITE(out_albedo, pixel, labels);
    WRITE(out_normal, pixel, faced);
#if OWN == 0
    MARK(pixel, missing);
#endif
#endif
}
