#version 430 core
// As depth.vert, with what the surface shader needs; gl_Position must be the same to the bit.
#include "surfaces.glsl"
in vec3 in_world;
in vec3 in_position;
in vec3 in_normal;
in uint in_surface;
uniform vec3 origin;
uniform mat3 axes;
uniform vec2 focal;
uniform vec2 shift;
uniform float near;
invariant gl_Position;
out vec3 metric;          // metric space of the object: scaled, not turned; textures live here
out vec3 metric_normal;
out vec3 from_camera;     // world axes
out float distance_m;     // along the viewing axis
// The surface's entry, flat: a table look-up per triangle is cheaper than one per sample.
flat out vec4 place[3];
flat out vec4 colour_a, colour_b, colour_c, maps, scale;

void main() {
    Surface s = surfaces[in_surface];
    metric = in_position * s.scale.xyz;
    metric_normal = in_normal / s.scale.xyz;
    from_camera = in_world - origin;
    vec3 local = axes * from_camera;
    distance_m = local.z;
    place = s.place;
    colour_a = s.colour_a;
    colour_b = s.colour_b;
    colour_c = s.colour_c;
    maps = s.maps;
    scale = s.scale;
    gl_Position = vec4(local.xy * focal + shift * local.z, local.z - 2.0 * near, local.z);
}
