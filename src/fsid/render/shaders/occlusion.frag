#version 430 core
// Share of the surroundings that each pixel sees: scalable ambient obscurance (McGuire et al. 2012) with one
// fixed spiral of taps for all pixels, at one sample per pixel. What the
// fixed pattern leaves of the outlines of occluders is smoothed by blur.frag. Output: openness 0..1, depth (0 = no hit).
#include "encoding.glsl"
layout(binding = 0) uniform usampler2D samples_a;
layout(binding = 1) uniform usampler2D samples_b;
layout(binding = 2) uniform sampler2D window_depth;
uniform int grid;        // samples per pixel and axis
uniform vec2 focal;      // half image sizes
uniform ivec2 size;      // pixels
uniform mat3 axes;       // rows right, up, forward
const int TAPS = 32;
uniform vec2 taps[TAPS];
layout(location = 0) out vec2 result;

const float RADIUS_M = 0.35;
const float MAX_SCREEN = 0.2;   // of the image width

vec3 at(ivec2 pixel, out bool hit) {
    ivec2 sample_at = pixel * grid + grid / 2;
    hit = texelFetch(window_depth, sample_at, 0).r < 1.0;
    float z = uintBitsToFloat(texelFetch(samples_b, sample_at, 0).x);
    vec2 ndc = (vec2(pixel) + 0.5 + (grid / 2 + 0.5 - 0.5 * grid) / grid) / vec2(size) * 2.0 - 1.0;
    return vec3(ndc.x / focal.x, -ndc.y / focal.y, 1.0) * z;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    bool hit;
    vec3 p = at(pixel, hit);
    if (!hit) { result = vec2(1.0, 0.0); return; }
    vec3 n = axes * unpack_direction(texelFetch(samples_a, pixel * grid + grid / 2, 0).y);
    float reach = min(0.5 * RADIUS_M * focal.x / p.z, MAX_SCREEN) * float(size.x);
    float r2 = RADIUS_M * RADIUS_M, sum = 0.0;
    float floor_m = 0.004 + 0.003 * p.z;
    for (int i = 0; i < TAPS; ++i) {
        ivec2 other = clamp(pixel + ivec2(round(taps[i] * reach)), ivec2(0), size - 1);
        bool other_hit;
        vec3 v = at(other, other_hit) - p;
        float vv = dot(v, v), f = max(r2 - vv, 0.0);
        if (other_hit) sum += f * f * f * max(dot(v, n) - floor_m, 0.0) / (vv + 0.0004);
    }
    float covered = sum * 5.0 * RADIUS_M / (r2 * r2 * r2 * float(TAPS));
    result = vec2(max(1.0 - covered, 0.1), p.z);
}
