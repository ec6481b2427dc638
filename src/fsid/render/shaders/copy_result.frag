#version 430 core
// One result as another: see fsid.render.targets.
layout(binding = 11) uniform sampler2D radiance;
layout(binding = 12) uniform sampler2D albedo;
layout(binding = 13) uniform sampler2D normal;
layout(location = 0) out vec4 out_radiance;
layout(location = 1) out vec4 out_albedo;
layout(location = 2) out vec4 out_normal;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    out_radiance = texelFetch(radiance, pixel, 0);
    out_albedo = texelFetch(albedo, pixel, 0);
    out_normal = texelFetch(normal, pixel, 0);
}
