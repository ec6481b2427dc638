// Unit vectors in 32 bits: octahedral map (Cigolle et al. 2014), two signed 16-bit numbers.
vec2 sign_not_zero(vec2 v) {
    return vec2(v.x >= 0.0 ? 1.0 : -1.0, v.y >= 0.0 ? 1.0 : -1.0);
}

// n: of any length.
uint pack_direction(vec3 n) {
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    p = n.z < 0.0 ? (1.0 - abs(p.yx)) * sign_not_zero(p) : p;
    return packSnorm2x16(p);
}

vec3 unpack_direction(uint code) {
    vec2 p = unpackSnorm2x16(code);
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    n.xy = n.z < 0.0 ? (1.0 - abs(n.yx)) * sign_not_zero(n.xy) : n.xy;
    return normalize(n);
}
