#version 430 core
// Nothing to see: work that keeps the rasteriser busy, see fsid.render.drain.
out vec4 result;

void main() {
    vec4 value = gl_FragCoord;
    int left = 400;
    do value = sin(value); while (--left > 0);
    result = value;
}
