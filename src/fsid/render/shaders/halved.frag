#version 430 core
// A mip level from the one above it: the mean of the texels that a texel covers. FORMAT: of both.
#include "screen.glsl"
layout(binding = 0) uniform sampler2D image;
uniform int level;
OUTPUT(0, FORMAT, result);

void main() {
    BEGIN(texel);
    vec2 at = (vec2(texel) + 0.5) / vec2(textureSize(image, level));
    WRITE(result, texel, textureLod(image, at, float(level - 1)));
}
