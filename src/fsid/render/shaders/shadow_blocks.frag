#version 430 core
// Share of each light that reaches one sample per block of 2 x 2 pixels, for shade.frag to interpolate where it
// varies smoothly: four lights a texel, the next four below, blocks.y rows each. 2: not smooth enough for that, or not
// asked because the light does not reach this face: around its edges it may reach others. 0 also where it cannot
// reach this face between this block and the next ones, so that no pixel there visits it.
#include "screen.glsl"
#include "encoding.glsl"
#include "lights.glsl"
#include "moments.glsl"
#include "shadows.glsl"
#include "lens.glsl"
UINT_TEXELS(0, rgba32ui, samples);
uniform ivec2 blocks;
uniform bool through;     // whether there are surfaces that pass light on
uniform mat3 axes;        // rows right, up, forward
uniform vec3 origin;
OUTPUT(0, rgba32f, shares);

const float SLANTED = 0.05;   // cosine below which a surface is not followed further
const float AROUND = 4.0;     // blocks: farther than a point on this face that the block counts for, and its others
const float BEHIND = -0.7;    // cosine from which on a light is behind all faces that are alike (MIN_FACE_COSINE)

void main() {
    BEGIN(at);
    ivec2 texel = block_texel(ivec2(at.x, at.y % blocks.y));
    uvec4 code = FETCH(samples, texel);
    vec3 ray = seen_ray((vec2(texel) + 0.5) / float(GRID)) * axes;
    vec3 n = unpack_direction(code.y);
    float depth = uintBitsToFloat(code.w);
    vec3 position = ray * depth + origin;
    float slant = max(abs(dot(n, ray)) / length(ray), SLANTED);
    float block_m = depth * length(4.0 / (seen_focal * vec2(seen))) / slant;
    float around = AROUND * block_m;
    int first = 4 * (at.y / blocks.y), i = 0;
    uint left = 0u;
    vec4 result = vec4(0);
    do {
        Light light = light_at(first + i);
        bool area = light.kind == AREA;
        vec3 to_light = light.kind == SUN ? -light.direction : light.position - position;
        float distance_m = max(length(to_light), 1e-6);
        float ahead = dot(n, to_light), below = dot(light.direction, to_light);
        bool reached = area ? below < 0.0
            : any(greaterThan(arriving(light, to_light / distance_m, distance_m), vec3(0)));
        left |= code.z > 0u && reached && (through || ahead > -0.15 * distance_m) ? 1u << i : 0u;
        bool behind = !through && !area && around < 0.1 * distance_m && ahead < BEHIND * distance_m;
        bool outside = area ? below > around
            : light.cos_outer >= -1.0 && below > around - light.cos_outer * distance_m;
        result[i] = behind || outside ? 0.0 : 2.0;
    } while (++i < min(4, light_count - first));
    do {
        int k = max(findLSB(left), 0);
        bool even, wanted = left != 0u;
        float lit = visibility(light_at(first + k), position, n, wanted, block_m, even);
        result[k] = even && wanted ? lit : result[k];
        left &= left - 1u;
    } while (left != 0u);
    WRITE(shares, at, result);
}
