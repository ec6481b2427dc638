#version 430 core
// One mip level of one layer from a buffer of packed RGBA8 texels.
layout(local_size_x = 8, local_size_y = 8) in;
layout(std430, binding = 0) readonly buffer Texels { uint texels[]; };
layout(rgba8, binding = 0) writeonly uniform image2DArray target;
uniform int layer;
uniform int size;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (at.x >= size || at.y >= size) return;
    imageStore(target, ivec3(at, layer), unpackUnorm4x8(texels[at.y * size + at.x]));
}
