// How far a column and a row of the atlas lead on the surface [mm], in margins as where the surface goes on; 1 inside a
// chart; 1 where there is a surface.

uniform sampler2D position_map, link_map;
out vec4 stretch;

// A point and 1 where the surface goes on, else 0.
vec4 point_at(ivec2 texel) {
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, textureSize(link_map, 0)))) return vec4(0.0);
    vec3 link = texelFetch(link_map, texel, 0).xyz;
    if (link.z < 0.5) return vec4(0.0);
    vec2 corner = floor(link.xy), rest = link.xy - corner;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        ivec2 step = ivec2(i & 1, i >> 1);
        vec2 near = mix(1.0 - rest, rest, vec2(step));
        vec4 there = texelFetch(position_map, clamp(ivec2(corner) + step, ivec2(0), textureSize(position_map, 0) - 1), 0);
        sum += near.x * near.y * vec4(there.xyz * there.w, there.w);
    }
    return sum.w > 0.0 ? vec4(sum.xyz / sum.w, 1.0) : vec4(0.0);
}

float along(ivec2 here, vec3 own, ivec2 step) {
    vec4 ahead = point_at(here + step), behind = point_at(here - step);
    vec3 from = behind.w > 0.5 ? behind.xyz : own, to = ahead.w > 0.5 ? ahead.xyz : own;
    return length(to - from) / max(ahead.w + behind.w, 1.0);
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 own = point_at(here);
    float inside = step(0.5, texelFetch(position_map, here, 0).w);
    stretch = own.w * vec4(along(here, own.xyz, ivec2(1, 0)), along(here, own.xyz, ivec2(0, 1)), inside, 1.0);
}
