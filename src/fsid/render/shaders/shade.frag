#version 430 core
// Radiance of one pixel from its samples. Samples that lie on one plane of one surface are shaded once, at their
// mean: the spread of their normals widens the highlight, and textures are filtered over the pixel. A pixel
// inside a surface is one such group, one at an edge two or three. Output: the frame at its final size.
// GRID: edge of the square of samples per pixel. LOBES: 1 with clearcoat, sheen and translucency. AREAS: 1 with
// area lights. GLASS: 1 in the second pass, whose samples are glass alone and which looks what is behind up in
// the result of the first. PLANAR: 1 with an image of the scene as smooth ground in z = 0 reflects it.
#include "encoding.glsl"
#include "surfaces.glsl"
#include "material.glsl"
#include "lights.glsl"
#include "room.glsl"
#include "lens.glsl"
layout(binding = 8) uniform usampler2D samples;
layout(binding = 9) uniform sampler2D occlusion;
layout(binding = 15) uniform sampler2D lit_blocks;   // of shadow_blocks.frag
uniform int block_lights;   // how many lights it holds
layout(binding = 10) uniform sampler2D sky;   // equirectangular
uniform float sky_level;  // mip level at which a texel of the sky is a pixel; -1 without sky
uniform vec3 vignetting;
uniform float shining;    // 1; 0 in the image that a mirror shows, where lights have highlights instead
#if PLANAR
layout(binding = 11) uniform sampler2D mirror_image;    // as out_radiance, with mips
#endif
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
const int COUNT = GRID * GRID, MIDDLE = (GRID / 2) * (GRID + 1);   // samples of a pixel, and the labels' own
const float COAT_F0 = 0.04;   // index 1.5

struct Sample {
    vec3 position;
    vec3 normal, face_normal;
    float depth;
    int surface;         // -1: nothing was hit
};

Sample sample_at(vec2 at) {
    vec3 ray = ray_at(at);
    ivec2 texel = clamp(ivec2(seen_at(ray) * float(GRID)), ivec2(0), seen * GRID - 1);
    uvec4 code = texelFetch(samples, texel, 0);
    vec3 face_normal = unpack_direction(code.y);
    float depth = uintBitsToFloat(code.w);
#if LENS > 0
    // This ray meets the plane that the nearest ray of the pinhole image has met.
    vec3 facing = axes * face_normal;
    depth *= clamp(dot(facing, seen_ray((vec2(texel) + 0.5) / float(GRID))) / dot(facing, ray), 0.9, 1.1);
#endif
    return Sample(ray * depth * axes + origin, unpack_direction(code.x), face_normal, depth, int(code.z) - 1);
}

vec2 place_of(ivec2 pixel, int i) { return vec2(pixel) + (vec2(i % GRID, i / GRID) + 0.5) / float(GRID); }

bool alike(Sample a, Sample b) {
    return a.surface == b.surface && dot(a.face_normal, b.face_normal) > MIN_FACE_COSINE
        && dot(a.normal, b.normal) > MIN_NORMAL_COSINE
        && abs(dot(a.position - b.position, a.face_normal)) < PLANE_TOLERANCE * a.depth;
}

// The samples still `open` that are like the first of them, as one; they are taken out of `open`. Its normal
// is the mean: its length tells the spread.
Sample next_group(Sample all[COUNT], inout uint open, out float members) {
    Sample first = all[COUNT - 1];
    for (int i = COUNT - 2; i >= 0; --i) if ((open & (1u << i)) != 0u) first = all[i];
    Sample mean = first;
    vec3 moved = vec3(0);
    mean.normal = vec3(0);
    members = 0.0;
    uint rest = open;
    for (int i = 0; i < COUNT; ++i) {
        bool joins = (rest & (1u << i)) != 0u && alike(first, all[i]);
        float one = joins ? 1.0 : 0.0;
        open &= joins ? ~(1u << i) : ~0u;
        members += one;
        moved += one * (all[i].position - first.position);
        mean.normal += one * all[i].normal;
    }
    open &= rest - 1u;    // the first itself, whatever its numbers
    members = max(members, 1.0);
    mean.position = first.position + moved / members;
    mean.normal /= members;
    return mean;
}

// The four blocks of 2 x 2 pixels around a point.
struct Blocks {
    ivec2 at[4];
    float share[4];     // bilinear
    bool even;          // whether their samples lie on the point's own surface
};

Blocks blocks_around(Sample p) {
    vec3 local = axes * (p.position - origin);
    vec2 at = 0.5 * (seen_at(local / local.z) - block_place(ivec2(0)));
    ivec2 corner = ivec2(floor(at)), last = textureSize(occlusion, 0) - 1;
    vec2 f = at - vec2(corner);
    Blocks b;
    b.even = all(greaterThanEqual(corner, ivec2(0))) && all(lessThan(corner, last));
    for (int i = 0; i < 4; ++i) {
        ivec2 cell = ivec2(i & 1, i >> 1);
        vec2 near = mix(1.0 - f, f, vec2(cell));
        b.share[i] = near.x * near.y;
        b.at[i] = clamp(corner + cell, ivec2(0), last);
        ivec2 texel = block_texel(b.at[i]);
        uvec4 code = texelFetch(samples, texel, 0);
        vec3 position = seen_ray((vec2(texel) + 0.5) / float(GRID)) * uintBitsToFloat(code.w) * axes + origin;
        b.even = b.even && int(code.z) - 1 == p.surface
            && dot(unpack_direction(code.y), p.face_normal) > MIN_FACE_COSINE
            && abs(dot(position - p.position, p.face_normal)) < PLANE_TOLERANCE * p.depth;
    }
    return b;
}

// Openness of the blocks that lie at this depth: the blur of the fixed tap pattern stops at edges.
float openness(Blocks b, float depth) {
    float sum = 0.0, total = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec2 o = texelFetch(occlusion, b.at[i], 0).xy;
        float d = (o.y - depth) / (0.02 * depth);
        float w = (b.share[i] + 1e-3) / (1e-3 + d * d);
        sum += w * o.x;
        total += w;
    }
    return sum / total;
}

// Share of a light that arrives, between the blocks' samples; more than 1 where that must be found here.
float interpolated(Blocks b, int light) {
    int row = light * textureSize(occlusion, 0).y;
    float sum = 0.0, most = b.even && light < block_lights ? 0.0 : 2.0;
    for (int i = 0; i < 4; ++i) {
        float lit = texelFetch(lit_blocks, b.at[i] + ivec2(0, row), 0).r;
        sum += b.share[i] * lit;
        most = max(most, lit);
    }
    return most > 1.0 ? 2.0 : sum;
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

// What a surface reflects of light from anywhere, at one point and seen from one side.
struct Reflector {
    vec3 n, v, r;         // normal, to the viewer, mirrored viewer
    vec3 diffuse;         // albedo of the body
    vec3 f0;
    float alpha, alpha2;  // GGX
    vec3 rebound;         // what one bounce between microfacets loses, given back (Turquin 2019)
    vec3 mirror;          // share of even surroundings that the GGX lobe reflects
#if LOBES
    // The layers above take their share of what arrives at those below.
    float coat, coated, coat_alpha, sheen, cloth, below;
    vec3 through;         // diffuse light that leaves on the other side
#endif
};

Reflector reflector_of(Sample p, Surface s, Matter m, float spread) {
    Reflector b;
    b.v = normalize(origin - p.position);
    b.n = normalize(m.normal);
    b.r = reflect(-b.v, b.n);
    b.alpha2 = min(m.alpha2 + 2.0 * spread, 1.0);
    b.alpha = sqrt(b.alpha2);
    b.diffuse = m.albedo * ((1.0 - m.metallic) * (1.0 - s.specular));
    float nv = max(abs(dot(b.n, b.v)), 1e-3);
#if GLASS
    b.diffuse *= 1.0 - s.transmission;
#endif
#if LOBES
    vec2 coat_share = mirror_share(sqrt(s.clearcoat_alpha), nv);
    b.coat_alpha = s.clearcoat_alpha;
    b.sheen = s.sheen;
    b.cloth = s.sheen * fuzz_share(nv);
    b.coated = s.clearcoat * (1.0 - b.cloth);
    float coat = s.clearcoat * (COAT_F0 * coat_share.x + coat_share.y);
    b.below = (1.0 - coat) * (1.0 - b.cloth);
    b.coat = coat * (1.0 - b.cloth);
    b.through = b.diffuse * s.translucency * b.below;
    b.diffuse *= 1.0 - s.translucency;
#endif
    b.f0 = mix(vec3(s.specular), m.albedo, m.metallic);
    vec2 share = mirror_share(sqrt(b.alpha), nv);
    b.rebound = 1.0 + b.f0 * (1.0 / max(share.x + share.y, 0.1) - 1.0);
    b.mirror = b.rebound * (b.f0 * share.x + min(share.y, 50.0 * max(b.f0.r, max(b.f0.g, b.f0.b))));
    return b;
}

// What of a light's radiance or intensity leaves towards the viewer, shadows aside.
vec3 returned(Light light, Sample p, Reflector b) {
    vec3 to_light = light.kind == SUN ? -light.direction : light.position - p.position;
    float distance_m = max(length(to_light), 1e-6);
    vec3 l = to_light / distance_m;
    float ahead = dot(p.face_normal, l), nl = dot(b.n, l);
    float angular = light.kind == SUN ? light.radius_m : light.radius_m / max(distance_m, light.radius_m);
    float wide = min(sqrt(b.alpha2 + 0.25 * angular * angular), 1.0);
    vec3 unhindered = arriving(light, l, distance_m);
    vec3 arrives = unhindered * smoothstep(-0.15, 0.0, ahead);
    vec3 result = (b.diffuse * (max(nl, 0.0) / PI) + b.rebound * reflected(b.f0, wide, b.n, b.v, l)) * arrives;
#if LOBES
    float coat_wide = min(sqrt(b.coat_alpha * b.coat_alpha + 0.25 * angular * angular), 1.0);
    result = result * b.below + b.through * unhindered * (smoothstep(-0.15, 0.0, -ahead) * max(-nl, 0.0) / PI)
        + (b.coated * reflected(vec3(COAT_F0), coat_wide, b.n, b.v, l) + b.sheen * fuzz(b.n, b.v, l)) * arrives;
#endif
#if AREAS
    bool area = light.kind == AREA;
    int edges = area && dot(to_light, light.direction) < 0.0 ? 5 : 0;
    float front = form_factor(light, p.position, upright(b.n), edges);
    float glossy = form_factor(light, p.position, lobe_of(sqrt(b.alpha), b.n, b.v), edges);
    vec3 from_area = b.diffuse * front + b.mirror * glossy;
#if LOBES
    from_area = from_area * b.below + b.cloth * front
        + b.coat * form_factor(light, p.position, lobe_of(sqrt(b.coat_alpha), b.n, b.v), edges)
        + b.through * form_factor(light, p.position, upright(-b.n), edges);
#endif
    result = area ? edges > 0 ? light.colour * from_area : vec3(0) : result;
#endif
    return result;
}

// Light of all lights. First those whose shadow is interpolated; the others need their own, which costs much
// more, one after the other: lights differ from pixel to pixel in that loop, so that it is short.
vec3 lights_on(Sample p, Reflector b, Blocks blocks) {
    vec3 sum = vec3(0);
    int i = 0;
    do {
        int first = i;
        uint left = 0u;
        do {
            vec3 light = returned(light_at(i), p, b);
            bool wanted = i < light_count && max(light.r, max(light.g, light.b)) > 0.0;
            float lit = interpolated(blocks, i);
            left |= wanted && lit > 1.0 ? 1u << (i - first) : 0u;
            sum += wanted && lit <= 1.0 ? lit * light : vec3(0);
        } while (++i < min(light_count, first + 32));
        do {
            bool wanted = left != 0u;
            Light light = light_at(first + (wanted ? findLSB(left) : 0));
            float even_m, lit = visibility(light, p.position, p.face_normal, wanted, even_m);
            sum += wanted ? lit * returned(light, p, b) : vec3(0);
            left &= left - 1u;
        } while (left != 0u);
    } while (i < light_count);
    return sum;
}

#if PLANAR
// Metres from the ground to what is mirrored at a place of the mirror's image (0..1).
float mirrored_at(vec2 at, float depth, float reach) {
    ivec2 texels = textureSize(mirror_image, 0);
    float far = texelFetch(mirror_image, clamp(ivec2(at * vec2(texels)), ivec2(0), texels - 1), 0).a;
    return far > 0.0 ? max(far / depth - 1.0, 0.0) * reach : 1e3;
}

// The image of smooth ground at a point of it, in direction r: blurred as the things around need, near ones above
// all, so that their edges do not glow into what is far behind them.
vec3 ground_image(Sample p, vec3 r, float alpha) {
    vec3 local = axes * (p.position - origin);
    float reach = length(local), width = 2.0 * alpha * 0.5 * seen_focal.x;
    vec2 at = seen_at(local / local.z) / vec2(seen);
    float beyond = mirrored_at(at, local.z, reach);
    vec2 aside = vec2(1.0, float(seen.x) / float(seen.y)) * min(width * beyond / (beyond + reach), 0.1);
    float nearness = 1.0 / max(beyond, 1e-3);
    for (int i = 0; i < 8; ++i) {
        float turn = float(i) * 0.25 * PI;
        vec2 step = aside * vec2(cos(turn), sin(turn)) * (0.5 + 0.5 * float(i & 1));
        nearness += 1.0 / max(mirrored_at(at + step, local.z, reach), 1e-3);
    }
    float nearest = 9.0 / nearness;
    vec3 there = axes * ((p.position + r * beyond) * vec3(1, 1, -1) - origin);
    vec2 moved = clamp(seen_at(there / max(there.z, 1e-3)) / vec2(seen), 0.0, 1.0);
    float texels = width * float(textureSize(mirror_image, 0).x) * nearest / (nearest + reach);
    return textureLod(mirror_image, moved, log2(max(texels, 1.0))).rgb;
}
#endif

// What comes from direction r, averaged over a lobe of width alpha: the room's walls or the sky; on smooth ground
// the things that stand on it.
vec3 surroundings_in(Sample p, vec3 r, float alpha) {
    vec3 room = mirrored(p.position, r, alpha);
#if PLANAR
    bool ground = abs(p.position.z) < 0.002 && p.face_normal.z > 0.999;
    float share = ground ? 1.0 - smoothstep(0.12, 0.25, alpha) : 0.0;
    room = mix(room, ground_image(p, r, alpha), share);
#endif
    return room;
}

vec3 radiance(Sample p, Surface s, Matter m, float spread) {
    Reflector b = reflector_of(p, s, m, spread);
    Blocks blocks = blocks_around(p);
    vec3 surroundings = cube(ambient_sides, b.n) * b.diffuse + b.mirror * surroundings_in(p, b.r, b.alpha);
#if LOBES
    surroundings = surroundings * b.below + b.coat * surroundings_in(p, b.r, b.coat_alpha)
                 + b.cloth * cube(ambient_sides, b.n) + b.through * cube(ambient_sides, -b.n);
#endif
    vec3 result = lights_on(p, b, blocks) + openness(blocks, p.depth) * surroundings;
#if GLASS
    float mirror = b.mirror.g / b.rebound.g;
    float passes = s.transmission * (1.0 - m.metallic) * (1.0 - mirror) * (1.0 - mirror);
    result += passes * m.albedo * seen_through(p, s, b.n, b.v);
#endif
    return result;
}

vec3 sky_at(vec3 direction) {
    vec3 d = normalize(direction);
    vec2 uv = vec2(atan(d.y, d.x) / (2.0 * PI), acos(clamp(d.z, -1.0, 1.0)) / PI);
    vec3 walls = (1.0 - shining) * mirrored(origin, d, 0.0);    // seen in a mirror where there are none
    return sky_level < 0.0 ? walls : textureLod(sky, uv, sky_level).rgb;
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
    uint open = (1u << COUNT) - 1u;
    Sample all[COUNT];
    for (int i = 0; i < COUNT; ++i) all[i] = sample_at(place_of(pixel, i));
#if GLASS
    for (int i = 0; i < COUNT; ++i) open &= all[i].surface < 0 ? ~(1u << i) : ~0u;
#endif
    vec3 sum = vec3(0), albedo = vec3(0), relief = vec3(0);
    int id = 0;
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
        m.normal = front ? m.normal : -m.normal;
        vec3 light = radiance(p, s, m, spread);
        light += shining * (s.emission * m.albedo + (front ? s.glow : vec3(0)));
#if GLASS
        covered += hit ? members : 0.0;
        sum += hit ? members * light : vec3(0);
#else
        sum += members * (hit ? light : sky_at(ray));
#endif
        albedo += hit ? members * m.albedo : vec3(0);
        bool labels = ((before & ~open) & (1u << MIDDLE)) != 0u && hit;
        relief = labels ? m.normal - turned : relief;
        id = labels ? s.object_id : id;
    } while (open != 0u);
    Sample label = all[MIDDLE];
    vec2 corner = (vec2(pixel) + 0.5) / vec2(size) * 2.0 - 1.0;
    float r2 = dot(corner, corner * vec2(size * size)) / dot(vec2(size), vec2(size));
    float gain = max(1.0 + r2 * (vignetting.x + r2 * (vignetting.y + r2 * vignetting.z)), 0.0);
    out_radiance = vec4(sum * (gain / float(COUNT)), label.surface >= 0 ? label.depth : 0.0);
    out_albedo = vec4(albedo / float(COUNT), float(id) / 65535.0);
    vec3 normal = dot(label.normal, label.face_normal) < 0.0 ? -label.normal : label.normal;
    normal = axes * normalize(normal + relief) * vec3(1, 1, -1);
    out_normal = vec4(0.5 + 0.5 * (label.surface >= 0 ? normal : vec3(0, 0, 1)), 0.0);
#if GLASS
    float bare = 1.0 - covered / float(COUNT);
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
