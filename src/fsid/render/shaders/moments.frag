#version 430 core
// Means of 1 / z and 1 / z^2 over 2 x 2 texels of the shadow atlas: what soft shadows filter.
layout(binding = 0) uniform sampler2D depth;
uniform float near;
layout(location = 0) out vec2 moments;

void main() {
    ivec2 corner = 2 * ivec2(gl_FragCoord.xy);
    vec4 d = vec4(texelFetch(depth, corner, 0).r, texelFetch(depth, corner + ivec2(1, 0), 0).r,
                  texelFetch(depth, corner + ivec2(0, 1), 0).r, texelFetch(depth, corner + ivec2(1, 1), 0).r);
    vec4 inverse_z = (1.0 - d) / near;
    moments = 0.25 * vec2(dot(inverse_z, vec4(1)), dot(inverse_z, inverse_z));
}
