#version 430 core
// What is seen: every vertex with its surface, for visible.frag. rows of `axes` are right, up, forward.
in vec3 in_world;
in vec3 in_normal;
in uint in_surface;
uniform vec3 origin;
uniform mat3 axes;
uniform vec2 focal;
uniform vec2 shift;
uniform float near;
uniform uint layer;       // 0 what is opaque, 1 glass
uniform vec4 kept;        // normal and offset of a plane: what lies behind it is cut off
out vec3 from_camera;     // world axes
out vec3 normal;
out float distance_m;     // along the viewing axis
flat out uint surface;

void main() {
    from_camera = in_world - origin;
    vec3 local = axes * from_camera;
    distance_m = local.z;
    normal = in_normal;
    gl_ClipDistance[0] = dot(in_world, kept.xyz) - kept.w;
    surface = in_surface & 0x7fffffffu;
    gl_Position = vec4(local.xy * focal + shift * local.z, local.z - 2.0 * near, local.z);
    if (in_surface >> 31 != layer) gl_Position = vec4(0.0, 0.0, -2.0, 1.0);   // clipped
}
