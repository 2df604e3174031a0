// Fur of a ball about the origin.
uniform float ball;

// The t of the shell that p is on: |p - t tall force| = ball + t tall.
float height_of(vec3 p) {
    float a = tall * tall * (1.0 - dot(force, force));
    float b = tall * (dot(p, force) + ball);
    float c = dot(p, p) - ball * ball;
    return c / (b + sqrt(max(b * b + a * c, 0.0)));
}

// How far along a ray it comes into a shell, and out of it.
vec2 level(vec3 o, vec3 d, float t) {
    vec3 away = o - t * tall * force;
    float along = dot(away, d);
    vec3 off = away - along * d;  // its square loses no digits from afar
    float r = ball + t * tall;
    float under = r * r - dot(off, off);
    float half_way = sqrt(max(under, 0.0));
    return under < 0.0 ? vec2(NONE) : vec2(-along - half_way, -along + half_way);
}

// The way over the skin that a ray goes between two places, from strand to strand.
float crossed(vec3 from, vec3 to) {
    vec3 one = normalize(from - height_of(from) * tall * force);
    vec3 other = normalize(to - height_of(to) * tall * force);
    return 2.0 * ball * asin(min(0.5 * length(other - one), 1.0));
}

vec3 normal_at(vec3 p) {
    return normalize(p);
}

// Maps hold the directions of feet; a clump gathers the directions of its strands toward its centre.
Strand strand_near(vec3 p, float t, int which) {
    vec3 way = normalize(p - t * tall * force);
    if (gathered > 0.0) {
        vec3 centre = over_net(clump_map, way).xyz;
        float left = 1.0 - t * tall * gathered / (ball + t * tall);  // of the way to the centre
        way = centre + (way - centre) / left;
    }
    vec3 up = (which == 0 ? over_net(nearest_map, way) : over_net(next_map, way)).xyz;
    return Strand(ball * up, up, up + force + gathered_at(up));
}
