// What a surface does with light that arrives: GGX over a matt body, under clearcoat and cloth's fuzz.
const float COAT_INDEX = 1.5;   // fsid.render.reflectance

// GGX with height-correlated Smith masking (Heitz 2014), Fresnel's share apart: D G cos(l) / (4 nv nl). vh: cosine at
// the microfacets.
float microfacets(float alpha, vec3 n, vec3 v, vec3 l, out float vh) {
    vec3 h = normalize(v + l);
    float nl = max(dot(n, l), 0.0), nv = max(abs(dot(n, v)), 1e-3), nh = max(dot(n, h), 0.0);
    float a2 = alpha * alpha;
    float t = nh * nh * (a2 - 1.0) + 1.0;
    float d = a2 / (PI * t * t);
    float g = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
    vh = clamp(dot(v, h), 0.0, 1.0);
    return d * 0.5 * nl / max(g, 1e-4);
}

// f * cos at the light, with Schlick's Fresnel.
vec3 reflected(vec3 f0, float alpha, vec3 n, vec3 v, vec3 l) {
    float vh, share = microfacets(alpha, n, v, l, vh);
    float s = 1.0 - vh, s2 = s * s;
    return (f0 + (1.0 - f0) * (s2 * s2 * s)) * share;
}

#if AREAS
// Cosine at the microfacets that mirror the middle of an area light, as `form_factor` has it. Within a lobe Fresnel's
// share may grow tenfold: that of these is taken, and the more of the lobe is light, the more that of all of it.
float facets_at(mat3 bend, vec3 middle, vec3 v) {
    vec3 l = inverse(bend) * middle;
    return clamp(dot(v, normalize(v + l * inversesqrt(max(dot(l, l), 1e-30)))), 0.0, 1.0);
}
#endif

#if LOBES
// Fresnel's equations at cosine c: at 45 to 65 degrees Schlick's misses 15 to 23 % of index 1.5.
float clear_fresnel(float c) {
    float g = sqrt(COAT_INDEX * COAT_INDEX - 1.0 + c * c);
    float across = (g - c) / (g + c), tilt = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    return 0.5 * across * across * (1.0 + tilt * tilt);
}

// f * cos of a clear coat.
float coat_reflected(float alpha, vec3 n, vec3 v, vec3 l) {
    float c, share = microfacets(alpha, n, v, l, c);
    return clear_fresnel(c) * share;
}

// Cloth's fuzz of alpha 0.5 (Estevez and Kulla 2017) with the visibility of Neubelt and Pettineo (2013); f, without
// the cosine at the light.
float fuzz(vec3 n, vec3 v, vec3 l) {
    float nl = max(dot(n, l), 0.0), nv = max(abs(dot(n, v)), 1e-3), nh = dot(n, normalize(v + l));
    return (2.0 / PI) * max(1.0 - nh * nh, 0.0) / (4.0 * max(nl + nv - nl * nv, 1e-3));
}

// Share of light that it reflects: the integral of `fuzz` times that cosine, fitted to 0.004.
float fuzz_share(float nv) {
    float r = sqrt(nv);
    return 0.787036 + r * (-0.717702 + r * (-0.122279 + r * 0.137787));
}
#endif

// What a surface reflects of light from anywhere, at one point and seen from one side.
struct Reflector {
    vec3 n, v, r;         // normal, to the viewer, mirrored viewer
    vec3 diffuse;         // albedo of the body
    vec3 f0;
    float alpha, alpha2;  // GGX
    vec3 rebound;         // what one bounce between microfacets loses, given back (Turquin 2019)
    vec3 mirror;          // share of even surroundings that the GGX lobe reflects
#if GLASS
    vec3 clear;           // share of the light behind that passes
#endif
#if AREAS
    mat3 facing, lobe;    // bend directions so that the body's and the mirror's share of light is a cosine around z
    float whole, edge;    // of the mirror: share of even surroundings without Fresnel; reflectance at grazing angles
#endif
#if LOBES
    // The layers above take their share of what arrives at those below.
    float coat, coated, coat_alpha, sheen, cloth, below;
    vec3 through;         // diffuse light that leaves on the other side
#if AREAS
    mat3 coat_lobe;
    float coat_whole;
#endif
#endif
};

Reflector reflector_of(Sample p, Surface s, Matter m, float spread) {
    Reflector b;
    b.v = normalize(origin - p.position);
    b.n = normalize(m.normal);
    b.r = reflect(-b.v, b.n);
    b.alpha2 = min(m.alpha2 + m.lost + 2.0 * spread, 1.0);
    b.alpha = sqrt(b.alpha2);
    float nv = max(abs(dot(b.n, b.v)), 1e-3);
    vec2 share = mirror_share(sqrt(b.alpha), nv);
    float taken = max(s.specular, s.specular * share.x + min(share.y, 50.0 * s.specular));   // by the mirror
    b.diffuse = m.albedo * ((1.0 - m.metallic) * (1.0 - taken));
#if GLASS
    b.diffuse *= 1.0 - s.transmission;
#endif
#if LOBES
    b.coat_alpha = sqrt(min(s.clearcoat_alpha * s.clearcoat_alpha + m.lost + 2.0 * spread, 1.0));
    b.sheen = s.sheen;
    b.cloth = s.sheen * fuzz_share(nv);
    b.coated = s.clearcoat * (1.0 - b.cloth);
    vec4 coat_share = reflectance_at(sqrt(b.coat_alpha), nv, 0.0);
    float coat = s.clearcoat * coat_share.z;
    b.below = (1.0 - coat) * (1.0 - b.cloth);
    b.coat = coat * (1.0 - b.cloth);
    b.through = b.diffuse * s.translucency * b.below;
    b.diffuse *= 1.0 - s.translucency;
#endif
    b.f0 = mix(vec3(s.specular), m.albedo, m.metallic);
    b.rebound = 1.0 + b.f0 * (1.0 / max(share.x + share.y, 0.1) - 1.0);
    float most = 50.0 * max(b.f0.r, max(b.f0.g, b.f0.b));
    b.mirror = b.rebound * (b.f0 * share.x + min(share.y, most));
#if GLASS
    // A slab with light to and fro between its faces (Stokes 1862); its colour is what is left after one way through.
    vec3 way = m.albedo * (1.0 - b.mirror), echoes = max(1.0 - m.albedo * m.albedo * b.mirror * b.mirror, 1e-4);
    float slab = s.transmission * (1.0 - m.metallic);
    b.clear = slab * way * (1.0 - b.mirror) / echoes;
    vec3 both_faces = 1.0 + slab * way * way / echoes;
    b.mirror *= both_faces;
    b.rebound *= both_faces;
#if LOBES
    b.clear *= b.below;
#endif
#endif
#if AREAS
    b.facing = upright(b.n);
    b.whole = share.x + share.y;
    b.edge = min(most, 1.0);
    b.lobe = lobe_of(sqrt(b.alpha), b.n, b.v);
#if LOBES
    b.coat_lobe = lobe_of(sqrt(b.coat_alpha), b.n, b.v);
    b.coat_whole = b.coated * (coat_share.x + coat_share.y);
#endif
#endif
    return b;
}

// What of a light's radiance or intensity leaves towards the viewer, shadows aside.
vec3 returned(Light light, Sample p, Reflector b) {
    vec3 to_light = light.kind == SUN ? -light.direction : light.position - p.position;
    float distance_m = max(length(to_light), 1e-6);
    vec3 l = to_light / distance_m;
    float ahead = dot(p.face_normal, l), nl = dot(b.n, l);
    float angular = light.kind == SUN ? light.radius_m : light.radius_m / max(distance_m, light.radius_m);
    float wide = min(sqrt(b.alpha2 + 0.25 * angular * angular), 1.0);
    vec3 unhindered = arriving(light, l, distance_m);
    vec3 arrives = unhindered * smoothstep(-0.15, 0.0, ahead);
    vec3 result = (b.diffuse * (max(nl, 0.0) / PI) + b.rebound * reflected(b.f0, wide, b.n, b.v, l)) * arrives;
#if LOBES
    float coat_wide = min(sqrt(b.coat_alpha * b.coat_alpha + 0.25 * angular * angular), 1.0);
    result = result * b.below + b.through * unhindered * (smoothstep(-0.15, 0.0, -ahead) * max(-nl, 0.0) / PI)
        + (b.coated * coat_reflected(coat_wide, b.n, b.v, l) + b.sheen * max(nl, 0.0) * fuzz(b.n, b.v, l)) * arrives;
#endif
#if AREAS
    bool area = light.kind == AREA, seen = area && dot(to_light, light.direction) < 0.0;
    vec3 towards, middle;
    float front = form_factor(light, p.position, b.facing, seen, towards);
    float glossy = form_factor(light, p.position, b.lobe, seen, middle);
    float slant = 1.0 - facets_at(b.lobe, middle, b.v), slant2 = slant * slant;
    vec3 there = b.rebound * b.whole * mix(b.f0, vec3(b.edge), slant2 * slant2 * slant);
    vec3 from_area = b.diffuse * front + mix(there, b.mirror, glossy) * glossy;
#if LOBES
    bool passes = max(b.through.r, max(b.through.g, b.through.b)) > 0.0;
    float in_coat = form_factor(light, p.position, b.coat_lobe, seen && b.coat > 0.0, middle);
    float coat_there = b.coat_whole * clear_fresnel(facets_at(b.coat_lobe, middle, b.v));
    // The fuzz as it is at the middle of the light, and the more of all that the surface faces is light, the more as a
    // whole. It is divided by that cosine already, which `front` has.
    vec3 centre = towards * b.facing * inversesqrt(max(dot(towards, towards), 1e-30));
    float fuzz_there = PI * b.sheen * fuzz(b.n, b.v, centre);
    from_area = from_area * b.below + mix(fuzz_there, b.cloth, front) * front
        + mix(coat_there, b.coat, in_coat) * in_coat
        + b.through * form_factor(light, p.position, flipped(b.facing), seen && passes);
#endif
    result = area ? seen ? light.colour * from_area : vec3(0) : result;
#endif
    return result;
}
