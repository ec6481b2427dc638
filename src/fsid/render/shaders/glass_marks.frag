#version 430 core
// Marks the pixels with glass in one of their samples. LENS, GRID: as in shade.frag.
#include "screen.glsl"
#include "encoding.glsl"
#include "lens.glsl"
#include "samples.glsl"

void main() {
    BEGIN(pixel);
    uint glass = 0u;
    for (int i = 0; i < COUNT; ++i)
        glass |= FETCH(samples, texel_seen(ray_at(place_of(pixel, i)))).z;
    MARK(pixel, glass != 0u);
}
