// Fur of a plane that repeats: z is up, and the force has no part along it.
uniform float side;

float height_of(vec3 p) {
    return p.z / tall;
}

vec2 level(vec3 o, vec3 d, float t) {
    return vec2((t * tall - o.z) / d.z, NONE);
}

// The way over the skin that a ray goes between two places, from strand to strand.
float crossed(vec3 from, vec3 to) {
    return length((to - from).xy - (to.z - from.z) * force.xy);
}

vec3 normal_at(vec3 p) {
    return vec3(0.0, 0.0, 1.0);
}

// Maps hold the way from a texel's middle to the foot.
Strand strand_near(vec3 p, float t, int which) {
    int texels = textureSize(nearest_map, 0).x;
    vec2 place = floor((p.xy - t * tall * force.xy) / side * float(texels));
    ivec2 texel = ivec2(mod(place, float(texels)));
    vec4 away = which == 0 ? texelFetch(nearest_map, texel, 0) : texelFetch(next_map, texel, 0);
    vec3 up = vec3(0.0, 0.0, 1.0);
    return Strand(vec3((place + 0.5) * side / float(texels) + away.xy, 0.0), up, up + force);
}
