#version 430 core
// Share of the surroundings that each block of 2 x 2 pixels sees: scalable ambient obscurance (McGuire et al.
// 2012) with four fixed spirals of taps, one for each block of a square of 2 x 2. What they differ by, and what
// they leave of the outlines of occluders, is smoothed by blur.frag, whose weights take equal shares of all four.
// Output: openness 0..1, depth (0 = no hit).
#include "screen.glsl"
#include "encoding.glsl"
UINT_TEXELS(0, rgba32ui, samples);
TEXELS(1, rg32f, depth);      // metres, of the blocks; 0 = no hit
TEXELS(7, rg32f, tap_table);  // row 2: where the spirals begin
uniform int stride;      // samples per block and axis
uniform vec2 focal;      // half image sizes
uniform vec2 shift;      // half image sizes
uniform ivec2 size;      // blocks
uniform mat3 axes;       // rows right, up, forward
uniform int taps;
OUTPUT(0, rgba32f, result);

const float RADIUS_M = 0.35;
const float MAX_SCREEN = 0.2;   // of the image width; what lies beyond counts as open
const float GOLDEN_ANGLE = 2.3999632;
const vec2 TURN = vec2(cos(4.0 * GOLDEN_ANGLE), sin(4.0 * GOLDEN_ANGLE));   // from a tap to the next of its spiral

// Where the ray of a block meets the plane 1 m ahead (x right, y up): block * per_block + corner.
void plane_ahead(out vec2 per_block, out vec2 corner) {
    vec2 flip = vec2(1, -1) / focal, all = vec2(size * stride);
    per_block = flip * (2.0 * float(stride) / all);
    corner = flip * ((2.0 * float(stride / 2) + 1.0) / all - 1.0 - shift);
}

void main() {
    BEGIN(block);
    vec2 per_block, corner;
    plane_ahead(per_block, corner);
    float z = FETCH(depth, block).r;
    bool hit = z > 0.0;
    vec3 p = vec3(vec2(block) * per_block + corner, 1.0) * z;
    vec3 n = axes * unpack_direction(FETCH(samples, block * stride + stride / 2).y);
    float whole = 0.5 * RADIUS_M * focal.x / max(z, 1e-3), reached = min(MAX_SCREEN / whole, 1.0);
    float reach = reached * whole * float(size.x);
    float r2 = RADIUS_M * RADIUS_M, sum = 0.0;
    float floor_m = 0.004 + 0.003 * z;
    int spiral = (block.x & 1) + 2 * (block.y & 1);
    vec2 tap = FETCH(tap_table, ivec2(spiral, 2)).xy;
    float radius = length(tap) * reach;
    vec2 direction = normalize(tap);
    int i = 0, count = hit ? taps : 0;
    do {
        ivec2 other = clamp(block + ivec2(round(radius * direction)), ivec2(0), size - 1);
        direction = mat2(TURN.x, TURN.y, -TURN.y, TURN.x) * direction;
        radius += reach / float(taps);
        float other_z = FETCH(depth, other).r;
        vec3 v = vec3(vec2(other) * per_block + corner, 1.0) * other_z - p;
        float vv = dot(v, v), f = max(r2 - vv, 0.0);
        sum += other_z > 0.0 ? f * f * f * max(dot(v, n) - floor_m, 0.0) / (vv + 0.0004) : 0.0;
    } while (++i < count);
    float covered = reached * sum * 5.0 * RADIUS_M / (r2 * r2 * r2 * float(taps));
    WRITE(result, block, hit ? vec4(max(1.0 - covered, 0.1), z, 0, 0) : vec4(1, 0, 0, 0));
}
