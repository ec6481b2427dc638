// The images that flat smooth surfaces show: see fsid.render.mirror. PLANAR: how many there are.
layout(binding = 11) uniform sampler2D mirror_images[PLANAR];    // as out_radiance, with mips
uniform vec4 mirror_planes[PLANAR];   // normal, offset

vec3 reflected_in(vec4 plane, vec3 at) { return at - 2.0 * (dot(at, plane.xyz) - plane.w) * plane.xyz; }

// Metres from the mirror to what is mirrored at a place of its image (0..1).
float mirrored_at(sampler2D image, vec2 at, float depth, float reach) {
    ivec2 texels = textureSize(image, 0);
    float far = texelFetch(image, clamp(ivec2(at * vec2(texels)), ivec2(0), texels - 1), 0).a;
    return far > 0.0 ? max(far / depth - 1.0, 0.0) * reach : 1e3;
}

// The image of a mirror at a point of it, in direction r: blurred as the things around need, near ones above
// all, so that their edges do not glow into what is far behind them. wanted: false gives nothing of use, soon.
vec3 mirror_image(sampler2D image, vec4 plane, Sample p, vec3 r, float alpha, bool wanted) {
    vec3 local = axes * (p.position - origin);
    float reach = length(local), width = 2.8 * alpha * 0.5 * seen_focal.x;   // as a path tracer blurs
    vec2 at = seen_at(local / local.z) / vec2(seen);
    float beyond = mirrored_at(image, at, local.z, reach);
    vec2 aside = vec2(1.0, float(seen.x) / float(seen.y)) * min(width * beyond / (beyond + reach), 0.1);
    float nearness = 1.0 / max(beyond, 1e-3);
    vec2 direction = vec2(1, 0);
    int i = wanted ? 0 : 7;
    do {
        vec2 step = aside * direction * (0.5 + 0.5 * float(i & 1));
        nearness += 1.0 / max(mirrored_at(image, at + step, local.z, reach), 1e-3);
        direction = sqrt(0.5) * vec2(direction.x - direction.y, direction.x + direction.y);
    } while (++i < 8);
    float nearest = 9.0 / nearness;
    vec3 there = axes * (reflected_in(plane, p.position + r * beyond) - origin);
    vec2 moved = clamp(seen_at(there / max(there.z, 1e-3)) / vec2(seen), 0.0, 1.0);
    float texels = width * float(textureSize(image, 0).x) * nearest / (nearest + reach);
    return textureLod(image, moved, log2(max(texels, 1.0))).rgb;
}

// `room`, what a point mirrors of its surroundings in direction r, with the image of a mirror over it where it lies in
// the mirror's plane.
vec3 with_mirror(sampler2D image, vec4 plane, vec3 room, Sample p, vec3 r, float alpha) {
    bool inside = abs(dot(p.position, plane.xyz) - plane.w) < 0.002 && dot(p.face_normal, plane.xyz) > 0.999;
    float share = inside ? 1.0 - smoothstep(0.12, 0.25, alpha) : 0.0;
    vec3 shown = mirror_image(image, plane, p, r, alpha, share > 0.0);
    return share > 0.0 ? mix(room, shown, share) : room;    // there may be no such mirror
}

// With all of them: no loop, because some drivers take the wrong image where it is not written out.
vec3 with_mirrors(vec3 room, Sample p, vec3 r, float alpha) {
    room = with_mirror(mirror_images[0], mirror_planes[0], room, p, r, alpha);
#if PLANAR > 1
    room = with_mirror(mirror_images[1], mirror_planes[1], room, p, r, alpha);
#endif
    return room;
}
