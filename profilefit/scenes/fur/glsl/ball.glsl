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

vec3 normal_at(vec3 p) {
    return normalize(p);
}

// Maps hold the directions of feet, over an octahedron's net.
Strand strand_near(vec3 p, float t, int which) {
    vec3 way = p - t * tall * force;
    vec2 net = way.xy / (abs(way.x) + abs(way.y) + abs(way.z));
    vec2 sides = vec2(net.x < 0.0 ? -1.0 : 1.0, net.y < 0.0 ? -1.0 : 1.0);
    net = way.z < 0.0 ? (1.0 - abs(net.yx)) * sides : net;
    int texels = textureSize(nearest_map, 0).x;
    ivec2 texel = ivec2(clamp((0.5 * net + 0.5) * float(texels), 0.0, float(texels) - 0.5));
    vec3 up = (which == 0 ? texelFetch(nearest_map, texel, 0) : texelFetch(next_map, texel, 0)).xyz;
    return Strand(ball * up, up);
}
