#version 430 core
// Share of the surroundings that each block of 2 x 2 pixels sees: scalable ambient obscurance (McGuire et al.
// 2012) with four fixed spirals of taps, one for each block of a square of 2 x 2. What they differ by, and what
// they leave of the outlines of occluders, is smoothed by blur.frag, whose weights take equal shares of all four.
// Output: openness 0..1, depth (0 = no hit).
#include "encoding.glsl"
layout(binding = 0) uniform usampler2D samples;
layout(binding = 1) uniform sampler2D depth;    // metres, of the blocks; 0 = no hit
layout(binding = 7) uniform sampler2D tap_table;   // row 2
uniform int stride;      // samples per block and axis
uniform vec2 focal;      // half image sizes
uniform vec2 shift;      // half image sizes
uniform ivec2 size;      // blocks
uniform mat3 axes;       // rows right, up, forward
uniform int taps;
layout(location = 0) out vec2 result;

const float RADIUS_M = 0.35;
const float MAX_SCREEN = 0.2;   // of the image width

vec3 at(ivec2 block, out bool hit) {
    float z = texelFetch(depth, block, 0).r;
    hit = z > 0.0;
    vec2 ndc = (vec2(block * stride + stride / 2) + 0.5) / vec2(size * stride) * 2.0 - 1.0 - shift;
    return vec3(ndc.x / focal.x, -ndc.y / focal.y, 1.0) * z;
}

void main() {
    ivec2 block = ivec2(gl_FragCoord.xy);
    bool hit;
    vec3 p = at(block, hit);
    vec3 n = axes * unpack_direction(texelFetch(samples, block * stride + stride / 2, 0).y);
    float reach = min(0.5 * RADIUS_M * focal.x / max(p.z, 1e-3), MAX_SCREEN) * float(size.x);
    float r2 = RADIUS_M * RADIUS_M, sum = 0.0;
    float floor_m = 0.004 + 0.003 * p.z;
    int spiral = (block.x & 1) + 2 * (block.y & 1);
    int i = 0, count = hit ? taps : 0;
    do {
        vec2 tap = texelFetch(tap_table, ivec2(4 * i + spiral, 2), 0).xy;
        ivec2 other = clamp(block + ivec2(round(tap * reach)), ivec2(0), size - 1);
        bool other_hit;
        vec3 v = at(other, other_hit) - p;
        float vv = dot(v, v), f = max(r2 - vv, 0.0);
        sum += other_hit ? f * f * f * max(dot(v, n) - floor_m, 0.0) / (vv + 0.0004) : 0.0;
    } while (++i < count);
    float covered = sum * 5.0 * RADIUS_M / (r2 * r2 * r2 * float(taps));
    result = hit ? vec2(max(1.0 - covered, 0.1), p.z) : vec2(1.0, 0.0);
}
