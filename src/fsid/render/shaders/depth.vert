#version 430 core
// Depth only, for the shadow maps: rows of `axes` are right, up, forward. range_m > 0: parallel light.
in vec3 in_world;
in uint in_surface;
uniform vec3 origin;
uniform mat3 axes;
uniform float focal;
uniform float near;
uniform float range_m;

void main() {
    vec3 local = axes * (in_world - origin);
    gl_Position = range_m > 0.0 ? vec4(local.xy * focal, local.z / range_m * 2.0 - 1.0, 1.0)
                                : vec4(local.xy * focal, local.z - 2.0 * near, local.z);
    if (in_surface >> 31 != 0u) gl_Position = vec4(0.0, 0.0, -2.0, 1.0);   // glass shades nothing
}
