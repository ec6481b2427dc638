// Unit vectors in 32 bits: octahedral map (Cigolle et al. 2014), two signed 16-bit numbers.
vec2 sign_not_zero(vec2 v) {
    return vec2(v.x >= 0.0 ? 1.0 : -1.0, v.y >= 0.0 ? 1.0 : -1.0);
}

uint pack_direction(vec3 n) {
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    if (n.z < 0.0) p = (1.0 - abs(p.yx)) * sign_not_zero(p);
    return packSnorm2x16(p);
}

vec3 unpack_direction(uint code) {
    vec2 p = unpackSnorm2x16(code);
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    if (n.z < 0.0) n.xy = (1.0 - abs(n.yx)) * sign_not_zero(n.xy);
    return normalize(n);
}

// One sample of the G-buffer in six words (24 bytes); albedo by its square root, which keeps dark colours precise.
struct Sample {
    vec3 albedo;
    vec3 normal;       // world, with relief
    vec3 face_normal;  // world, of the triangle, towards the viewer
    float alpha;       // GGX
    float metallic;
    float specular;    // dielectric reflectance at normal incidence
    float depth;       // metres along the viewing axis
    int object_id;     // one more than in the frame, below 65536
};

void pack_sample(Sample s, out uvec4 a, out uvec2 b) {
    vec3 root = sqrt(s.albedo);
    a = uvec4(pack_direction(s.normal), pack_direction(s.face_normal), packUnorm2x16(root.rg),
              packUnorm2x16(vec2(root.b, s.alpha)));
    b = uvec2(floatBitsToUint(s.depth),
              packUnorm4x8(vec4(0, 0, s.metallic, s.specular)) | uint(s.object_id));
}

Sample unpack_sample(uvec4 a, uvec2 b) {
    Sample s;
    s.normal = unpack_direction(a.x);
    s.face_normal = unpack_direction(a.y);
    vec2 rg = unpackUnorm2x16(a.z), ba = unpackUnorm2x16(a.w), ms = unpackUnorm4x8(b.y).zw;
    s.albedo = vec3(rg * rg, ba.x * ba.x);
    s.alpha = ba.y;
    s.metallic = ms.x;
    s.specular = ms.y;
    s.depth = uintBitsToFloat(b.x);
    s.object_id = int(b.y & 0xffffu);
    return s;
}
