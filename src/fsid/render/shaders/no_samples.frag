#version 430 core
// A G-buffer that holds nothing.
#include "screen.glsl"
layout(binding = 0, rgba32ui) writeonly uniform uimage2D samples;

void main() {
    BEGIN(texel);
    imageStore(samples, texel, uvec4(0));
}
