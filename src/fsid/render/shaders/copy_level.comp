#version 430 core
// One mip level of one layer from another array.
layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler2DArray source;
layout(rgba8, binding = 0) writeonly uniform image2DArray target;
uniform int level;
uniform int layer;
uniform int source_layer;
uniform int size;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (at.x >= size || at.y >= size) return;
    imageStore(target, ivec3(at, layer), texelFetch(source, ivec3(at, source_layer), level));
}
