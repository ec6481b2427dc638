// What blocks of 2 x 2 pixels know, between their samples: openness (occlusion.frag), light (shadow_blocks.frag).
layout(binding = 9) uniform sampler2D occlusion;
layout(binding = 15) uniform sampler2D lit_blocks;   // of shadow_blocks.frag
uniform int block_lights;   // how many lights it holds

// The four blocks of 2 x 2 pixels around a point.
struct Blocks {
    ivec2 at[4];
    float share[4];     // bilinear
    bool even;          // whether their samples lie on the point's own surface
};

Blocks blocks_around(Sample p) {
    vec3 local = axes * (p.position - origin);
    vec2 at = 0.5 * (seen_at(local / local.z) - block_place(ivec2(0)));
    ivec2 corner = ivec2(floor(at)), last = textureSize(occlusion, 0) - 1;
    vec2 f = at - vec2(corner);
    Blocks b;
    b.even = all(greaterThanEqual(corner, ivec2(0))) && all(lessThan(corner, last));
    for (int i = 0; i < 4; ++i) {
        ivec2 cell = ivec2(i & 1, i >> 1);
        vec2 near = mix(1.0 - f, f, vec2(cell));
        b.share[i] = near.x * near.y;
        b.at[i] = clamp(corner + cell, ivec2(0), last);
        ivec2 texel = block_texel(b.at[i]);
        uvec4 code = texelFetch(samples, texel, 0);
        vec3 position = seen_ray((vec2(texel) + 0.5) / float(GRID)) * uintBitsToFloat(code.w) * axes + origin;
        b.even = b.even && int(code.z) - 1 == p.surface
            && dot(unpack_direction(code.y), p.face_normal) > MIN_FACE_COSINE
            && abs(dot(position - p.position, p.face_normal)) < PLANE_TOLERANCE * p.depth;
    }
    return b;
}

// Openness between the blocks, at edges of those that lie at this depth: the blur of the tap pattern stops there.
float openness(Blocks b, float depth) {
    float sum = 0.0, total = 0.0;
    for (int i = 0; i < 4; ++i) {
        vec2 o = texelFetch(occlusion, b.at[i], 0).xy;
        float d = b.even ? 0.0 : (o.y - depth) / (0.02 * depth);
        float w = (b.share[i] + 1e-3) / (1e-3 + d * d);
        sum += w * o.x;
        total += w;
    }
    return sum / total;
}

// Share of a light that arrives, between the blocks' samples; more than 1 where that must be found here.
float interpolated(Blocks b, int light) {
    int row = light * textureSize(occlusion, 0).y;
    float sum = 0.0, most = b.even && light < block_lights ? 0.0 : 2.0;
    for (int i = 0; i < 4; ++i) {
        float lit = texelFetch(lit_blocks, b.at[i] + ivec2(0, row), 0).r;
        sum += b.share[i] * lit;
        most = max(most, lit);
    }
    return most > 1.0 ? 2.0 : sum;
}
