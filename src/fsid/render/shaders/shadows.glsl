// Share of a light that arrives: soft shadows from the atlas of fsid.render.shadows. Loops test at their end, as
// in lights.glsl.
layout(binding = 15) uniform sampler2DShadow shadow_compare;
TEXELS(7, rg32f, tap_table);        // row 0: search, row 1: filter; unit disc
uniform int search_taps;
uniform int filter_taps;
uniform float tile_px;

const float SHADOW_NEAR = 0.02;
const float SUN_MIDDLE = 0.5;    // of the sun's first tile, as in fsid.render.shadows
const float BIAS_M = 0.0015;
const float SHARP_TEXELS = 3.0, SOFT_TEXELS = 8.0;   // radius of the penumbra: below, above, blended between
const float LEAK = 0.1;          // share of light that overlapping occluders let through, cut off
const float STEEPEST = 12.0;     // tangent of the steepest receiver that is followed
const float DARK = 0.98;         // share of the search that is blocked where nothing more is looked for
const float TRACE = 1e-4, BEGUN = 0.003;   // taps of the search blocked: below no shadow, above all of it
const int TILE_COLUMNS = 6, NEAR_CELLS = 2;   // as in fsid.render.shadows

// Where a receiver is in its tile. u = 1 - window depth - middle is near / z (of the sun: 1/2 - z / range), which
// is linear over the tile for every plane.
struct Receiver {
    vec2 corner, centre;   // of the tile and of the receiver, 0..1 of the atlas
    vec2 to_atlas;         // tile units to 0..1 of the atlas
    vec2 slope;            // of u of the plane, per tile unit
    float u;
    float middle, farthest;   // what is taken off u; u where nothing is, which is nearer than what lies beyond
    float bias;            // of u
    float texel, tile_size;   // of the depth; tile units
    mat2 spread;           // how far the light's half axes move a shadow, per difference of u; tile units
    float search;          // radius of what may shade it, tile units
    bool inside;           // the tile; beyond the sun's first one nothing casts shadows
};

Receiver receiver_of(Light light, vec3 d, vec3 n) {
    bool one = light.tile_count < 6;
    vec3 a = abs(d);
    int axis = a.x >= a.y && a.x >= a.z ? 0 : a.y >= a.z ? 1 : 2;
    float side = d[axis] < 0.0 ? -1.0 : 1.0;
    int e = axis == 2 ? 0 : axis + 1, f = e == 2 ? 0 : e + 1;
    mat3 axes = transpose(mat3(light.right, light.up, light.direction));
    mat3 sides = transpose(mat3(vec3(e == 0, e == 1, e == 2), vec3(f == 0, f == 1, f == 2),
                                side * vec3(axis == 0, axis == 1, axis == 2)));
    if (!one) axes = sides;
    vec3 q = axes * d, m = axes * n;
    int tile = light.first_tile + (one ? 0 : 2 * axis + (side < 0.0 ? 1 : 0));
    bool sun = light.kind == SUN;

    Receiver r;
    vec2 atlas = 2.0 * vec2(textureSize(shadow_moments, 0));
    vec2 at = sun ? q.xy : q.xy / q.z;
    vec2 aside = at - light.half_width.xy;
    bool nearer = sun && light.tile_count == 2 && max(abs(aside.x), abs(aside.y)) < light.half_height.x;
    at = nearer ? aside : at;
    tile += nearer ? 1 : 0;
    float side_px = nearer ? float(NEAR_CELLS) * tile_px : tile_px;
    float facing = sun ? m.z : dot(m, q);
    float toward = (facing < 0.0 ? -1.0 : 1.0) / max(abs(facing), 1e-6);
    r.middle = nearer ? light.half_height.y : sun ? SUN_MIDDLE : 0.0;
    r.farthest = -r.middle;
    r.u = sun ? 1.0 - q.z / light.range_m - r.middle : SHADOW_NEAR / q.z;
    r.slope = m.xy * toward * (sun ? 1.0 / light.range_m : SHADOW_NEAR);
    float steep = sun ? STEEPEST / light.range_m : STEEPEST * r.u;
    r.slope *= min(1.0, steep / max(length(r.slope), 1e-12));
    r.bias = sun ? BIAS_M / light.range_m : BIAS_M * r.u * r.u / SHADOW_NEAR;
    r.tile_size = nearer ? 2.0 * light.half_width.z : 2.0 / light.focal;
    r.texel = r.tile_size / side_px;
    r.inside = !sun || max(abs(at.x), abs(at.y)) < 0.5 * r.tile_size;
    r.to_atlas = side_px / (atlas * r.tile_size);
    r.corner = vec2(tile % TILE_COLUMNS, tile / TILE_COLUMNS) * tile_px / atlas;
    r.centre = r.corner + r.to_atlas * (0.5 * r.tile_size + at);
    float per_u = sun ? light.range_m : 1.0 / SHADOW_NEAR;
    vec3 w = axes * light.half_width, h = axes * light.half_height;
    bool area = light.kind == AREA;
    r.spread = area ? per_u * mat2(w.xy - at * w.z, h.xy - at * h.z) : mat2(per_u * light.radius_m);
    float size = max(length(r.spread[0]), length(r.spread[1]));
    float nearest = sun ? 1.0 - r.middle - r.u : 2.0 * r.u;    // difference of u to the nearest blocker looked for
    float widest = max(light.border - 0.01, 2.0 * r.texel);
    float border = nearer ? light.half_width.z - light.half_height.x : light.border;
    r.search = clamp(size * nearest, 2.0 * r.texel, sun ? border : widest);
    return r;
}

// What the shadow map holds within `width` of a place on the receiver's plane, and the plane itself there.
struct Field {
    vec2 moments;          // means of u and u^2
    float limit;           // u of the plane
};

Field field_at(Receiver r, vec2 offset, float width) {
    vec2 inside = r.to_atlas * min(width, 0.5 * r.tile_size);
    vec2 uv = clamp(r.centre + r.to_atlas * offset, r.corner + inside, r.corner + r.to_atlas * r.tile_size - inside);
    vec2 moments = moments_at(uv, log2(max(width / (2.0 * r.texel), 1.0)));
    return Field(moments, max(r.u + dot(r.slope, (uv - r.centre) / r.to_atlas), r.farthest));
}

// Light that reaches the plane past that, by Chebyshev's inequality (Donnelly and Lauritzen 2006); exact for one
// occluder in front of the plane. blocked: summed u of the occluders (Yang et al. 2010).
float soft_lit(Receiver r, Field f, out float blocked) {
    float in_front = max(f.moments.x - f.limit - r.bias, 0.0);
    float variance = max(f.moments.y - f.moments.x * f.moments.x, 0.0);
    float lit = in_front > 0.0 ? variance / (variance + in_front * in_front) : 1.0;
    blocked = f.moments.x - lit * f.limit;
    return lit;
}

// Is there nothing but the receiver's own plane? Then no light is lost.
bool alone(Receiver r, Field f, float width) {
    float variance = f.moments.y - f.moments.x * f.moments.x;
    float own = dot(r.slope, r.slope) * width * width;
    return abs(f.moments.x - f.limit) < 0.3 * r.bias && variance < own + r.bias * r.bias;
}

// Whence the middle of an area light is asked for, relative to it. Where it is behind a face, or hardly before it, but
// a part of the light is not, all that the map shows in front is the body that the face is of: so from above the face,
// whose plane the way to the middle then crosses halfway, beyond most bodies.
vec3 raised(Light light, vec3 d, vec3 n) {
    float low = dot(n, d) + length(d) / STEEPEST;
    float part = abs(dot(n, light.half_width)) + abs(dot(n, light.half_height));
    return light.kind == AREA && low > 0.0 && dot(n, d) < part ? d + low * n : d;
}

// Share of the light seen from `position`: soft shadows by the mean depth of what is in the way
// (Fernando 2005), with fixed taps that are areas and not points, so that they leave no pattern; where the
// penumbra is a few texels, a percentage-closer filter on the depth itself. Where all that the penumbra can
// reach is of one kind, nothing is filtered. wanted: false asks nothing.
// even: whether the result is as smooth as the receiver within around_m metres.
float visibility(Light light, vec3 position, vec3 face_normal, bool wanted, float around_m, out bool even) {
    Receiver r = receiver_of(light, raised(light, position - light.position, face_normal), face_normal);
    float shaded = 0.0, blocked_sum = 0.0, blocked, farthest = 1.2 * r.search;
    Field all = field_at(r, vec2(0), farthest);
    bool asked = wanted && r.inside, closed = asked && soft_lit(r, all, blocked) < 1.0 - DARK;
    int taps = asked && !closed && !alone(r, all, farthest) ? search_taps : 0;
    mat2 search = r.spread * (r.search / max(max(length(r.spread[0]), length(r.spread[1])), 1e-12));
    float width = 0.3 * r.search;
    int i = 0;
    do {
        vec2 offset = search * FETCH(tap_table, ivec2(i, 0)).xy;
        float lit = soft_lit(r, field_at(r, offset, width), blocked);
        shaded += i < taps ? 1.0 - lit : 0.0;
        blocked_sum += i < taps ? blocked : 0.0;
    } while (++i < taps);
    bool dark = closed || shaded > DARK * float(search_taps);
    float nearer = shaded < BEGUN ? 0.0 : max(blocked_sum / shaded - r.u, 0.0);
    mat2 spread = r.spread * nearer;
    float size = max(length(spread[0]), length(spread[1]));
    float wide = clamp(size, 0.75 * r.texel, r.search);
    spread = size > 1e-12 ? spread * (wide / size) : mat2(wide);
    float soft = smoothstep(SHARP_TEXELS, SOFT_TEXELS, wide / r.texel);

    float around = around_m * (light.kind == SUN ? 1.0 : r.u / SHADOW_NEAR);
    float reach = max(1.2 * wide, 1.5 * around);   // to the corners of a block
    Field field = field_at(r, vec2(0), reach);
    float passed = soft_lit(r, field, blocked);
    // What lies far behind takes what is in front from the means of the search; close by it is seen, by each pixel
    // for itself: a block that has other surfaces close by, and in which the search found nothing, speaks for none.
    bool doubtful = taps > 0 && shaded < BEGUN && !alone(r, field, reach);
    shaded = asked ? max(shaded, 1.0 - passed) : 0.0;
    bool mixed = shaded >= TRACE && !dark;
    bool full = passed < 1.0 - DARK, settled = full || alone(r, field, reach), filtered = mixed && !settled;

    float sharp_sum = 0.0, bias = r.bias + (abs(r.slope.x) + abs(r.slope.y)) * r.texel;
    int sharp = filtered && soft < 1.0 ? filter_taps : 0;
    i = 0;
    do {
        vec2 offset = spread * FETCH(tap_table, ivec2(i, 1)).xy;
        float limit = max(r.u + dot(r.slope, offset), r.farthest) + bias;
        sharp_sum += textureLod(shadow_compare, vec3(r.centre + r.to_atlas * offset, 1.0 - r.middle - limit), 0.0);
    } while (++i < sharp);
    float soft_sum = 0.0;
    int smooth_taps = filtered && soft > 0.0 ? filter_taps : 0;
    i = 0;
    do {
        vec2 offset = spread * FETCH(tap_table, ivec2(i, 1)).xy;
        soft_sum += soft_lit(r, field_at(r, offset, 0.3 * wide), blocked);
    } while (++i < smooth_taps);
    float dim = 1.0 - soft_sum / float(filter_taps);
    float smoothed = max(1.0 - dim - LEAK * dim * dim * dim, 0.0);
    float lit = mix(sharp_sum / float(filter_taps), smoothed, soft);
    lit = mix(1.0, lit, smoothstep(TRACE, BEGUN, shaded));
    lit = filtered ? lit : dark || mixed && full ? 0.0 : 1.0;

    float followed = mixed ? 0.5 * (wide + r.texel) : taps > 0 ? r.search : farthest;
    bool same = mixed && (settled || lit >= 1.0 && passed >= 1.0);
    even = !wanted || !r.inside || !doubtful && (followed >= around || same);
    return lit;
}
