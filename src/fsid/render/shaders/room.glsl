// The surroundings as a light source: see fsid.render.room. Sides in the order +x -x +y -y +z -z.
layout(binding = 4) uniform sampler2DArray room_radiance;
uniform vec3 ambient_sides[6];   // ambient radiance that arrives from each side
uniform vec3 mean_sides[6];      // mean of room_radiance over each side
uniform vec3 room_half;          // half size of the room; under the sky so large that places do not matter
uniform vec3 room_centre;

// A value per side as a smooth function of direction: the ambient cube (McTaggart 2004), weights sum to one.
vec3 cube(vec3 sides[6], vec3 n) {
    vec3 w = n * n;
    return w.x * (n.x < 0.0 ? sides[1] : sides[0]) + w.y * (n.y < 0.0 ? sides[3] : sides[2])
         + w.z * (n.z < 0.0 ? sides[5] : sides[4]);
}

// What a mirror of roughness alpha at `position` sees in direction r: the wall where the ray meets it, and
// the rougher it is the more of whole walls, which blend where the room has edges.
vec3 mirrored(vec3 position, vec3 r, float alpha) {
    vec3 p = clamp(position - room_centre, -room_half, room_half);
    vec3 ray = mix(r, vec3(1e-6), lessThan(abs(r), vec3(1e-6)));
    vec3 t = (sign(ray) * room_half - p) / ray;
    int axis = t.x <= t.y && t.x <= t.z ? 0 : t.y <= t.z ? 1 : 2;
    vec3 at = 0.5 + 0.5 * (p + ray * t[axis]) / room_half;
    vec2 uv = vec2(at[(axis + 1) % 3], at[(axis + 2) % 3]);
    float texels = float(textureSize(room_radiance, 0).x);
    float width = 2.0 * min(room_half.x, min(room_half.y, room_half.z)) / texels;
    float level = min(log2(1.0 + 2.0 * alpha * t[axis] / width), log2(texels));
    vec3 wall = textureLod(room_radiance, vec3(uv, 2 * axis + (ray[axis] < 0.0 ? 1 : 0)), level).rgb;
    return mix(wall, cube(mean_sides, r), smoothstep(0.0, 0.4, alpha));
}

// Share of the surroundings that a surface reflects specularly: scale and offset of f0, and that of a clear coat
// (fsid.render.reflectance). In the upper half of the table the bent cosine that such a lobe is (tools/fit_lobes.py): a, b, c, d.
layout(binding = 14) uniform sampler2D reflectance;
const float TABLE_EDGE = 0.5 / 32.0;
vec4 reflectance_at(float roughness, float nv, float part) {
    vec2 at = clamp(vec2(nv, roughness), TABLE_EDGE, 1.0 - TABLE_EDGE);
    return textureLod(reflectance, vec2(at.x, 0.5 * (at.y + part)), 0.0);
}
vec2 mirror_share(float roughness, float nv) { return reflectance_at(roughness, nv, 0.0).xy; }

// Bends directions so that GGX's lobe of a surface n seen from v becomes a cosine around z.
mat3 lobe_of(float roughness, vec3 n, vec3 v) {
    vec4 w = reflectance_at(roughness, max(abs(dot(n, v)), 1e-3), 1.0);
    vec3 aside = v - n * dot(n, v);
    aside = dot(aside, aside) > 1e-8 ? normalize(aside) : normalize(cross(n, abs(n.x) < 0.7 ? vec3(1, 0, 0) : vec3(0, 1, 0)));
    return mat3(w.x, 0.0, w.w, 0.0, w.z, 0.0, w.y, 0.0, 1.0) * transpose(mat3(aside, cross(n, aside), n));
}
