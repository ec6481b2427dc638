#version 430 core
// Depth in metres and surface, from 1, of one sample per block of 2 x 2 pixels; 0 where nothing was hit.
layout(binding = 0) uniform usampler2D samples;
uniform int stride;
layout(location = 0) out vec2 result;

void main() {
    uvec4 s = texelFetch(samples, ivec2(gl_FragCoord.xy) * stride + stride / 2, 0);
    result = s.z > 0u ? vec2(uintBitsToFloat(s.w), s.z) : vec2(0);
}
