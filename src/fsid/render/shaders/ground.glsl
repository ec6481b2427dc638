// The image that smooth ground shows: see fsid.render.mirror.
layout(binding = 11) uniform sampler2D mirror_image;    // as out_radiance, with mips

// Metres from the ground to what is mirrored at a place of the mirror's image (0..1).
float mirrored_at(vec2 at, float depth, float reach) {
    ivec2 texels = textureSize(mirror_image, 0);
    float far = texelFetch(mirror_image, clamp(ivec2(at * vec2(texels)), ivec2(0), texels - 1), 0).a;
    return far > 0.0 ? max(far / depth - 1.0, 0.0) * reach : 1e3;
}

// The image of smooth ground at a point of it, in direction r: blurred as the things around need, near ones above
// all, so that their edges do not glow into what is far behind them. wanted: false gives nothing of use, soon.
vec3 ground_image(Sample p, vec3 r, float alpha, bool wanted) {
    vec3 local = axes * (p.position - origin);
    float reach = length(local), width = 2.0 * alpha * 0.5 * seen_focal.x;
    vec2 at = seen_at(local / local.z) / vec2(seen);
    float beyond = mirrored_at(at, local.z, reach);
    vec2 aside = vec2(1.0, float(seen.x) / float(seen.y)) * min(width * beyond / (beyond + reach), 0.1);
    float nearness = 1.0 / max(beyond, 1e-3);
    vec2 direction = vec2(1, 0);
    int i = wanted ? 0 : 7;
    do {
        vec2 step = aside * direction * (0.5 + 0.5 * float(i & 1));
        nearness += 1.0 / max(mirrored_at(at + step, local.z, reach), 1e-3);
        direction = sqrt(0.5) * vec2(direction.x - direction.y, direction.x + direction.y);
    } while (++i < 8);
    float nearest = 9.0 / nearness;
    vec3 there = axes * ((p.position + r * beyond) * vec3(1, 1, -1) - origin);
    vec2 moved = clamp(seen_at(there / max(there.z, 1e-3)) / vec2(seen), 0.0, 1.0);
    float texels = width * float(textureSize(mirror_image, 0).x) * nearest / (nearest + reach);
    return textureLod(mirror_image, moved, log2(max(texels, 1.0))).rgb;
}
