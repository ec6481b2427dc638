// Moments of shadow maps between their texels. GPUs weigh the texels that a lookup blends in steps of 1/256, which is
// grain in a wide penumbra, so there EXACT_FILTER is 1 and they are blended here. llvmpipe weighs them in float, and
// fetches the texels of several pixels from one level, which this must not.
layout(binding = 3) uniform sampler2D shadow_moments;   // means of u and u^2, half the size, with mips

#if EXACT_FILTER
vec2 level_at(vec2 uv, int level) {
    ivec2 last = textureSize(shadow_moments, level) - 1;
    vec2 at = uv * vec2(last + 1) - 0.5, f = fract(at);
    ivec2 low = clamp(ivec2(floor(at)), ivec2(0), last), high = clamp(ivec2(floor(at)) + 1, ivec2(0), last);
    vec2 a = texelFetch(shadow_moments, low, level).xy, b = texelFetch(shadow_moments, ivec2(high.x, low.y), level).xy;
    vec2 c = texelFetch(shadow_moments, ivec2(low.x, high.y), level).xy, d = texelFetch(shadow_moments, high, level).xy;
    return mix(mix(a, b, f.x), mix(c, d, f.x), f.y);
}

vec2 moments_at(vec2 uv, float level) {
    int low = int(level), last = textureQueryLevels(shadow_moments) - 1;
    return mix(level_at(uv, min(low, last)), level_at(uv, min(low + 1, last)), fract(level));
}
#else
vec2 moments_at(vec2 uv, float level) { return textureLod(shadow_moments, uv, level).xy; }
#endif
