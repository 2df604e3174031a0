// Vertices of the lattice as they land on the target, and shapes that they make.
uniform sampler2D hit_map;  // of hits.frag
uniform float pixel;  // side of one [m]
uniform float margin;  // around the tile [pixels]
uniform float side;  // of the target, both margins included [pixels]
uniform float mean_flux;

// Place on the target [pixels], and light of a cell of the lattice, 1 a pixel on average. Beyond the tile it repeats.
vec3 landed(ivec2 at) {
    int count = textureSize(hit_map, 0).x;
    float cell = (side - 2.0 * margin) / float(count);
    vec3 hit = texelFetch(hit_map, ivec2((at.x + count) % count, (at.y + count) % count), 0).xyz;
    return vec3((vec2(at) + 0.5) * cell + hit.xy / pixel + margin, hit.z / mean_flux * cell * cell);
}

vec4 on_target(vec2 place) {
    return vec4(2.0 * place / side - 1.0, 0.0, 1.0);
}

ivec2 cell_of(int number) {
    int count = textureSize(hit_map, 0).x;
    return ivec2(number % count, number / count);
}

float cross2(vec2 a, vec2 b) {
    return a.x * b.y - a.y * b.x;
}
