#version 430 core
// Depth only, for the prepass and the shadow maps: rows of `axes` are right, up, forward.
in vec3 in_world;
uniform vec3 origin;
uniform mat3 axes;
uniform vec2 focal;
uniform vec2 shift;
uniform float near;
invariant gl_Position;

void main() {
    vec3 local = axes * (in_world - origin);
    gl_Position = vec4(local.xy * focal + shift * local.z, local.z - 2.0 * near, local.z);
}
