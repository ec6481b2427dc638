#version 430 core
// A mip level from the one above it: the mean of the texels that a texel covers, blended linearly where sizes are odd.
// Fetched one by one: a lookup may touch the level that is being written, whatever weight it has. FORMAT: of both.
#include "screen.glsl"
layout(binding = 0) uniform sampler2D image;
uniform int level;
OUTPUT(0, FORMAT, result);

void main() {
    BEGIN(texel);
    ivec2 last = textureSize(image, level - 1) - 1;
    vec2 at = (vec2(texel) + 0.5) * vec2(last + 1) / vec2(textureSize(image, level)) - 0.5, f = fract(at);
    ivec2 low = clamp(ivec2(floor(at)), ivec2(0), last), high = clamp(ivec2(floor(at)) + 1, ivec2(0), last);
    vec4 a = texelFetch(image, low, level - 1), b = texelFetch(image, ivec2(high.x, low.y), level - 1);
    vec4 c = texelFetch(image, ivec2(low.x, high.y), level - 1), d = texelFetch(image, high, level - 1);
    WRITE(result, texel, mix(mix(a, b, f.x), mix(c, d, f.x), f.y));
}
