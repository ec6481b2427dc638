#version 430 core
// Means of u and u^2 over 2 x 2 texels of the shadow atlas, u = 1 - window depth - middle: what soft shadows filter.
// Where u is large its square leaves no digits for the variance, so the sun's is counted from the middle.
#include "screen.glsl"
layout(binding = 0) uniform sampler2D depth;
uniform float middle;
OUTPUT(0, rg32f, moments);

void main() {
    BEGIN(texel);
    ivec2 corner = 2 * texel;
    vec4 u = 1.0 - middle - vec4(texelFetch(depth, corner, 0).r, texelFetch(depth, corner + ivec2(1, 0), 0).r,
                        texelFetch(depth, corner + ivec2(0, 1), 0).r, texelFetch(depth, corner + ivec2(1, 1), 0).r);
    WRITE(moments, texel, 0.25 * vec4(dot(u, vec4(1)), dot(u, u), 0, 0));
}
