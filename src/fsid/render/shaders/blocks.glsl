// What blocks of 2 x 2 pixels know, between their samples: openness (occlusion.frag), light (shadow_blocks.frag).
TEXELS(1, rgba32f, occlusion);     // openness, depth, surface from 1
TEXELS(2, rgba32f, lit_blocks);    // of shadow_blocks.frag
uniform int block_lights;   // how many lights it holds

const float LEAST_OWN = 0.3;   // share of the blocks around a point that must lie on its face

// The four blocks of 2 x 2 pixels around a point.
struct Blocks {
    ivec2 at[4];
    float open[4], depth[4];
    float share[4];     // bilinear
    float own[4];       // the same among those whose samples lie on the point's own face; 0 if too few do
    bool even;          // whether all lie on its surface and plane
};

Blocks blocks_around(Sample p) {
    vec3 local = axes * (p.position - origin);
    vec2 at = 0.5 * (seen_at(local / local.z) - block_place(ivec2(0)));
    ivec2 corner = ivec2(floor(at)), last = EXTENT(occlusion) - 1;
    vec2 f = at - vec2(corner);
    Blocks b;
    b.even = all(greaterThanEqual(corner, ivec2(0))) && all(lessThan(corner, last));
    for (int i = 0; i < 4; ++i) {
        ivec2 cell = ivec2(i & 1, i >> 1);
        vec2 near = mix(1.0 - f, f, vec2(cell));
        b.share[i] = near.x * near.y;
        b.at[i] = clamp(corner + cell, ivec2(0), last);
        vec3 known = FETCH(occlusion, b.at[i]).rgb;
        vec2 place = (vec2(block_texel(b.at[i])) + 0.5) / float(GRID);
        vec3 position = seen_ray(place) * known.y * axes + origin;
        b.open[i] = known.x;
        b.depth[i] = known.y;
        bool own = int(known.z) - 1 == p.surface
            && abs(dot(position - p.position, p.face_normal)) < PLANE_TOLERANCE * p.depth;
        b.even = b.even && own;
        vec3 face_normal = unpack_direction(FETCH(samples, block_texel(b.at[i])).y);
        b.own[i] = own && dot(face_normal, p.face_normal) > MIN_FACE_COSINE ? b.share[i] : 0.0;
    }
    float total = b.own[0] + b.own[1] + b.own[2] + b.own[3];
    for (int i = 0; i < 4; ++i) b.own[i] = total > LEAST_OWN ? b.own[i] / total : 0.0;
    return b;
}

// Openness between the blocks, at edges of those that lie at this depth: the blur of the tap pattern stops there.
float openness(Blocks b, float depth) {
    float sum = 0.0, total = 0.0;
    for (int i = 0; i < 4; ++i) {
        float d = b.even ? 0.0 : (b.depth[i] - depth) / (0.02 * depth);
        float w = (b.share[i] + 1e-3) / (1e-3 + d * d);
        sum += w * b.open[i];
        total += w;
    }
    return sum / total;
}

// Shares of four lights that arrive, between the blocks' samples; more than 1 where that must be found here.
vec4 interpolated(Blocks b, int four) {
    int row = four * EXTENT(occlusion).y;
    bool any = b.own[0] + b.own[1] + b.own[2] + b.own[3] > 0.5;
    vec4 sum = vec4(0), most = vec4(any && 4 * four < block_lights ? 0.0 : 2.0);
    for (int i = 0; i < 4; ++i) {
        vec4 lit = FETCH(lit_blocks, b.at[i] + ivec2(0, row));
        sum += b.own[i] * lit;
        most = max(most, b.own[i] > 0.0 ? lit : vec4(0));
    }
    return mix(sum, vec4(2), greaterThan(most, vec4(1)));
}
