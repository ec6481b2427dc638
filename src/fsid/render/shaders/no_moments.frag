#version 430 core
// Moments of shadow maps that hold nothing.
#include "screen.glsl"
OUTPUT(0, rg32f, moments);

void main() {
    BEGIN(texel);
    WRITE(moments, texel, vec4(0));
}
