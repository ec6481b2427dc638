#version 430 core
// One result as another: see fsid.render.targets.
#include "screen.glsl"
layout(binding = 11) uniform sampler2D radiance;
layout(binding = 12) uniform sampler2D albedo;
layout(binding = 13) uniform sampler2D normal;
OUTPUT(0, rgba32f, out_radiance);
OUTPUT(1, rgba16, out_albedo);
OUTPUT(2, rgba16, out_normal);

void main() {
    BEGIN(pixel);
    WRITE(out_radiance, pixel, texelFetch(radiance, pixel, 0));
    WRITE(out_albedo, pixel, texelFetch(albedo, pixel, 0));
    WRITE(out_normal, pixel, texelFetch(normal, pixel, 0));
}
