#version 430 core
// Openness (r) averaged along one image axis with binomial weights, among pixels of like depth (g). b: surface.
#include "screen.glsl"
TEXELS(0, rgba32f, openness);
TEXELS(1, rg32f, blocks);   // of block_depth.frag
uniform ivec2 direction;
uniform ivec2 size;
OUTPUT(0, rgba32f, result);

const int REACH = 5;
const float WEIGHTS[REACH + 1] = float[](252.0, 210.0, 120.0, 45.0, 10.0, 1.0);
const float TOLERANCE = 0.02;   // of the depth, per pixel of distance

void main() {
    BEGIN(pixel);
    vec2 centre = FETCH(openness, pixel).xy;
    float sum = 0.0, total = 0.0;
    for (int i = -REACH; i <= REACH; ++i) {
        vec2 o = FETCH(openness, clamp(pixel + i * direction, ivec2(0), size - 1)).xy;
        float apart = abs(o.y - centre.y) / (TOLERANCE * max(centre.y, 1e-3) * (1.0 + abs(float(i))));
        float weight = WEIGHTS[abs(i)] * max(1.0 - apart * apart, 0.0);
        sum += weight * o.x;
        total += weight;
    }
    WRITE(result, pixel, vec4(sum / total, centre.y, FETCH(blocks, pixel).g, 0.0));
}
