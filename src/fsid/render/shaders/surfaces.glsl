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
