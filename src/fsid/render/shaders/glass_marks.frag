#version 430 core
// Marks in depth the pixels with glass in one of their samples: 0, all others 1. LENS, GRID: as in shade.frag.
#include "encoding.glsl"
#include "lens.glsl"
#include "samples.glsl"

void main() {
    uint glass = 0u;
    for (int i = 0; i < COUNT; ++i)
        glass |= texelFetch(samples, texel_seen(ray_at(place_of(ivec2(gl_FragCoord.xy), i))), 0).z;
    gl_FragDepth = glass != 0u ? 0.0 : 1.0;
}
