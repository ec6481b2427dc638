// Table of surfaces: one entry per part of a drawable (fsid.render.geometry.SURFACE).
struct Surface {
    vec4 place[3];   // rows of [rotation | position]
    vec4 scale;      // xyz; w: tiles per metre
    vec4 colour_a;   // rgb; w: cosine of the tile's turn
    vec4 colour_b;   // rgb; w: sine
    vec4 colour_c;   // rgb; w: roughness scale
    vec4 maps;       // layer, slope scale, specular, object id (as integer bits)
};
layout(std430, binding = 0) readonly buffer Surfaces { Surface surfaces[]; };

// Object -> metric space of the object: scaled, not yet turned. Textures live here, in metres.
vec3 to_metric(Surface s, vec3 position) { return position * s.scale.xyz; }

vec3 turn(Surface s, vec3 v) {
    return vec3(dot(s.place[0].xyz, v), dot(s.place[1].xyz, v), dot(s.place[2].xyz, v));
}

vec3 to_world(Surface s, vec3 metric) {
    return turn(s, metric) + vec3(s.place[0].w, s.place[1].w, s.place[2].w);
}
