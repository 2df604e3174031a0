// A map with its margin: there what it has where the surface goes on. Coverage, its fourth number, goes with it.

uniform sampler2D light_map, link_map;
out vec4 filled;

void main() {
    vec3 link = texelFetch(link_map, ivec2(gl_FragCoord.xy), 0).xyz;
    vec2 corner = floor(link.xy), rest = link.xy - corner;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        ivec2 step = ivec2(i & 1, i >> 1);
        vec2 near = mix(1.0 - rest, rest, vec2(step));
        vec4 there = texelFetch(light_map, clamp(ivec2(corner) + step, ivec2(0), textureSize(light_map, 0) - 1), 0);
        sum += near.x * near.y * there;
    }
    filled = link.z > 0.5 && sum.w > 0.0 ? sum / sum.w : vec4(0.0);
}
