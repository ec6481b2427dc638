#version 430 core
// Samples of the G-buffer at the middles of a grid of places.
#include "screen.glsl"
layout(binding = 0) uniform usampler2D samples;
uniform ivec2 places;     // columns and rows
layout(location = 0) out uvec4 result;

void main() {
    BEGIN(place);
    ivec2 all = textureSize(samples, 0);
    result = texelFetch(samples, (2 * place + 1) * all / (2 * places), 0);
}
