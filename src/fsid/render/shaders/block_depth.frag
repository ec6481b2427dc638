#version 430 core
// Depth in metres and surface, from 1, of one sample per block of 2 x 2 pixels; 0 where nothing was hit.
#include "screen.glsl"
UINT_TEXELS(0, rgba32ui, samples);
uniform int stride;
OUTPUT(0, rg32f, result);

void main() {
    BEGIN(block);
    uvec4 s = FETCH(samples, block * stride + stride / 2);
    WRITE(result, block, s.z > 0u ? vec4(uintBitsToFloat(s.w), s.z, 0, 0) : vec4(0));
}
