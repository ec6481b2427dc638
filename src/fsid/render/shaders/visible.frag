#version 430 core
// One sample of the G-buffer: which surface, where, and how it lies. Materials are evaluated once per pixel
// and surface by shade.frag, so this stays cheap enough to need no depth prepass.
#include "encoding.glsl"
in vec3 from_camera;
in vec3 normal;
in float distance_m;
flat in uint surface;
layout(location = 0) out uvec4 out_sample;

void main() {
    vec3 face = cross(dFdx(from_camera), dFdy(from_camera));
    face = dot(face, face) > 0.0 ? face : normal;
    face = dot(face, from_camera) > 0.0 ? -face : face;
    out_sample = uvec4(pack_direction(normal), pack_direction(face), surface + 1u, floatBitsToUint(distance_m));
}
