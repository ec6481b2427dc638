// The samples of a pixel, and those of them that are one surface: on one plane, of like normals.
UINT_TEXELS(0, rgba32ui, samples);
uniform mat3 axes;        // rows right, up, forward
uniform vec3 origin;

const float PLANE_TOLERANCE = 0.002;  // of the distance
const float MIN_FACE_COSINE = 0.97;
const float MIN_NORMAL_COSINE = 0.85;
const int COUNT = GRID * GRID, MIDDLE = (GRID / 2) * (GRID + 1);   // samples of a pixel, and the labels' own

struct Sample {
    vec3 position;
    vec3 normal, face_normal;
    float depth;
    int surface;         // -1: nothing was hit
};

// The sample nearest to a ray.
ivec2 texel_seen(vec3 ray) { return clamp(ivec2(seen_at(ray) * float(GRID)), ivec2(0), seen * GRID - 1); }

Sample sample_at(vec2 at) {
    vec3 ray = ray_at(at);
    ivec2 texel = texel_seen(ray);
    uvec4 code = FETCH(samples, texel);
    vec3 face_normal = unpack_direction(code.y);
    float depth = uintBitsToFloat(code.w);
#if LENS > 0
    // This ray meets the plane that the nearest ray of the pinhole image has met.
    vec3 facing = axes * face_normal;
    depth *= clamp(dot(facing, seen_ray((vec2(texel) + 0.5) / float(GRID))) / dot(facing, ray), 0.9, 1.1);
#endif
    return Sample(ray * depth * axes + origin, unpack_direction(code.x), face_normal, depth, int(code.z) - 1);
}

vec2 place_of(ivec2 pixel, int i) { return vec2(pixel) + (vec2(i % GRID, i / GRID) + 0.5) / float(GRID); }

bool alike(Sample a, Sample b) {
    return a.surface == b.surface && dot(a.face_normal, b.face_normal) > MIN_FACE_COSINE
        && dot(a.normal, b.normal) > MIN_NORMAL_COSINE
        && abs(dot(a.position - b.position, a.face_normal)) <= PLANE_TOLERANCE * a.depth;   // 0 = 0: the sky
}

// The samples still `open` that are like the first of them, as one; they are taken out of `open`. Its normal
// is the mean: its length tells the spread.
Sample next_group(Sample all[COUNT], inout uint open, out float members) {
    Sample first = all[COUNT - 1];
    for (int i = COUNT - 2; i >= 0; --i) if ((open & (1u << i)) != 0u) first = all[i];
    Sample mean = first;
    vec3 moved = vec3(0);
    mean.normal = vec3(0);
    members = 0.0;
    uint rest = open;
    for (int i = 0; i < COUNT; ++i) {
        bool joins = (rest & (1u << i)) != 0u && alike(first, all[i]);
        float one = joins ? 1.0 : 0.0;
        open &= joins ? ~(1u << i) : ~0u;
        members += one;
        moved += one * (all[i].position - first.position);
        mean.normal += one * all[i].normal;
    }
    open &= rest - 1u;    // the first itself, whatever its numbers
    members = max(members, 1.0);
    mean.position = first.position + moved / members;
    mean.normal /= members;
    return mean;
}
