// How far a column and a row of the atlas lead on the surface [mm], in margins as where the surface goes on; 1 inside a
// chart; the area of a texel [mm^2], which is less than their product where columns and rows are not at right angles.

uniform sampler2D position_map, filled_map; // of a chart, and with its margin
out vec4 stretch;

vec4 point_at(ivec2 texel) {
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, textureSize(filled_map, 0)))) return vec4(0.0);
    return texelFetch(filled_map, texel, 0);
}

vec3 along(ivec2 here, vec3 own, ivec2 step) {
    vec4 ahead = point_at(here + step), behind = point_at(here - step);
    vec3 from = behind.w > 0.5 ? behind.xyz : own, to = ahead.w > 0.5 ? ahead.xyz : own;
    return (to - from) / max(ahead.w + behind.w, 1.0);
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 own = point_at(here);
    vec3 column = along(here, own.xyz, ivec2(1, 0)), row = along(here, own.xyz, ivec2(0, 1));
    float inside = step(0.5, texelFetch(position_map, here, 0).w);
    stretch = own.w * vec4(length(column), length(row), inside, length(cross(column, row)));
}
