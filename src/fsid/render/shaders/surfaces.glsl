// Table of surfaces (fsid.render.geometry.SURFACE): ten texels a surface, in blocks of SURFACE_ROWS rows. A
// texel table and not a buffer: llvmpipe reads a texel nine times as fast as a buffer element.
TEXELS(5, rgba32f, surface_table);
const int SURFACE_TEXELS = 10;
const int SURFACE_ROWS = 2048;

struct Surface {
    vec3 place[3];      // rows of the rotation of the object
    vec3 position;
    vec3 colour_a, colour_b, colour_c;
    vec2 turn;          // cosine and sine of the tile's turn
    float tiles_per_m, layer, slope_scale, roughness_scale, specular;
    float clearcoat, clearcoat_alpha, sheen, translucency, transmission;
    vec3 glow;          // radiance of its own in front, whatever its albedo
    float emission;     // radiance per albedo
    int object_id;      // one more than in the frame
    float thickness_m;  // of glass
    bool patched;       // nothing repeats
};

Surface surface_at(int i) {
    ivec2 at = ivec2(SURFACE_TEXELS * (i / SURFACE_ROWS), i % SURFACE_ROWS);
    vec4 t[SURFACE_TEXELS];
    for (int k = 0; k < SURFACE_TEXELS; ++k) t[k] = FETCH(surface_table, at + ivec2(k, 0));
    Surface s;
    for (int k = 0; k < 3; ++k) s.place[k] = t[k].xyz;
    s.position = vec3(t[0].w, t[1].w, t[2].w);
    s.colour_a = t[3].rgb;
    s.colour_b = t[4].rgb;
    s.colour_c = t[5].rgb;
    s.turn = vec2(t[3].w, t[4].w);
    s.roughness_scale = t[5].w;
    s.tiles_per_m = t[6].x;
    s.layer = t[6].y;
    s.slope_scale = t[6].z;
    s.specular = t[6].w;
    s.clearcoat = t[7].x;
    s.clearcoat_alpha = t[7].y;
    s.sheen = t[7].z;
    s.translucency = t[7].w;
    s.glow = t[8].rgb;
    s.emission = t[8].w;
    s.transmission = t[9].x;
    s.object_id = int(t[9].y);
    s.thickness_m = t[9].z;
    s.patched = t[9].w > 0.5;
    return s;
}
