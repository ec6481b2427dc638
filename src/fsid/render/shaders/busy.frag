#version 430 core
// Nothing to see: work that keeps the rasteriser busy, see fsid.render.drain.
layout(binding = 16) uniform sampler2D nothing;   // one texel
out vec4 result;

void main() {
    vec4 value = gl_FragCoord + texelFetch(nothing, ivec2(0), 0);
    int left = 2000;
    do value = sin(value); while (--left > 0);
    result = value;
}
