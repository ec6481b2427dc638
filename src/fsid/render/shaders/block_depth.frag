#version 430 core
// Depth in metres of one sample per block of 2 x 2 pixels; 0 where nothing was hit.
layout(binding = 0) uniform usampler2D samples;
uniform int stride;
layout(location = 0) out float depth;

void main() {
    uvec4 s = texelFetch(samples, ivec2(gl_FragCoord.xy) * stride + stride / 2, 0);
    depth = s.z > 0u ? uintBitsToFloat(s.w) : 0.0;
}
