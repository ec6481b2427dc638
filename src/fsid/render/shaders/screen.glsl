// A program that finds each pixel of an image once, see fsid.render.programs.ScreenProgram. It declares what it
// writes with OUTPUT, starts with BEGIN, which names its pixel, and ends with WRITE and MARK.
// COMPUTE: 0 a fragment shader, drawn over all of the image; 1 a compute shader, which stores into images.
// MARKS: 1 MARK says of each pixel whether it is marked; 2 only marked pixels are found. A fragment shader's marks
// are depth, whose test keeps it from being run. ADDS: 1 adds to what is there; of fragments blending does that.
// Images that are read texel by texel are declared with TEXELS or UINT_TEXELS and bound by
// fsid.render.canvas.use_texels. Fragment shaders have them as images: llvmpipe finds the mip level that a texel of
// a texture is fetched from anew in every pixel, which takes longer than to fetch it. Compute shaders have few units
// of images, for what they write.
#if COMPUTE
layout(local_size_x = 8, local_size_y = 8) in;
uniform ivec2 first_pixel;
uniform ivec2 last_pixel;
#if MARKS
layout(binding = 3, r8) uniform image2D marks;
#endif
#define OUTPUT(place, format, name) layout(binding = place, format) uniform image2D name
#if MARKS == 2
#define IS_LEFT_OUT(pixel) any(greaterThan(pixel, last_pixel)) || imageLoad(marks, pixel).r == 0.0
#else
#define IS_LEFT_OUT(pixel) any(greaterThan(pixel, last_pixel))
#endif
#define BEGIN(pixel) ivec2 pixel = first_pixel + ivec2(gl_GlobalInvocationID.xy); if (IS_LEFT_OUT(pixel)) return
#if ADDS
#define WRITE(name, pixel, value) imageStore(name, pixel, imageLoad(name, pixel) + value)
#else
#define WRITE(name, pixel, value) imageStore(name, pixel, value)
#endif
#define MARK(pixel, is_marked) imageStore(marks, pixel, vec4(is_marked))
#define TEXELS(unit, format, name) layout(binding = unit) uniform sampler2D name
#define UINT_TEXELS(unit, format, name) layout(binding = unit) uniform usampler2D name
#define FETCH(name, place) texelFetch(name, place, 0)
#define EXTENT(name) textureSize(name, 0)
#else
#define OUTPUT(place, format, name) layout(location = place) out vec4 name
#define BEGIN(pixel) ivec2 pixel = ivec2(gl_FragCoord.xy)
#define WRITE(name, pixel, value) name = value
#define MARK(pixel, is_marked) gl_FragDepth = (is_marked) ? 0.0 : 1.0
#define TEXELS(unit, format, name) layout(binding = unit, format) readonly uniform image2D name
#define UINT_TEXELS(unit, format, name) layout(binding = unit, format) readonly uniform uimage2D name
#define FETCH(name, place) imageLoad(name, place)
#define EXTENT(name) imageSize(name)
#endif
