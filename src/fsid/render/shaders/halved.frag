#version 430 core
// A mip level from the one above it: the mean of what a texel covers, by the weights of fsid.render.mip_levels.
// Fetched one by one: a lookup may touch the level that is being written, whatever weight it has. FORMAT: of both.
#include "screen.glsl"
layout(binding = 0) uniform sampler2D image;
uniform int level;
OUTPUT(0, FORMAT, result);

ivec2 from, low;
vec2 second, third;    // share of the second texel of the first two, and of the third of all; 0 of even sides

vec4 texel_at(int x, int y) { return texelFetch(image, min(low + ivec2(x, y), from - 1), level - 1); }

vec4 row(int y) { return mix(mix(texel_at(0, y), texel_at(1, y), second.x), texel_at(2, y), third.x); }

void main() {
    BEGIN(texel);
    from = textureSize(image, level - 1);
    low = 2 * texel;
    ivec2 half_size = from / 2, odd = from & 1;
    second = mix(vec2(0.5), vec2(half_size) / vec2(max(2 * half_size - texel, 1)), vec2(odd));
    third = vec2(odd * (texel + 1)) / vec2(from);
    WRITE(result, texel, mix(mix(row(0), row(1), second.y), row(2), third.y));
}
