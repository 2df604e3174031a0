// Clumps of a ball's fur. gathered: displacement of a tip, over the length and the difference of centre and foot.
uniform sampler2D clump_map;
uniform float gathered;

// A map's texel toward a direction, over an octahedron's net.
vec4 over_net(sampler2D map, vec3 way) {
    vec2 net = way.xy / (abs(way.x) + abs(way.y) + abs(way.z));
    vec2 sides = vec2(net.x < 0.0 ? -1.0 : 1.0, net.y < 0.0 ? -1.0 : 1.0);
    net = way.z < 0.0 ? (1.0 - abs(net.yx)) * sides : net;
    int texels = textureSize(map, 0).x;
    return texelFetch(map, ivec2(clamp((0.5 * net + 0.5) * float(texels), 0.0, float(texels) - 0.5)), 0);
}

vec3 gathered_at(vec3 foot) {
    return gathered > 0.0 ? gathered * (over_net(clump_map, foot).xyz - foot) : vec3(0.0);
}
