// One map of caustics into its place in a column of them.
uniform sampler2D light_map;
uniform int below;  // rows of the column below this one
out vec4 light;

void main() {
    light = texelFetch(light_map, ivec2(gl_FragCoord.xy) - ivec2(0, below), 0);
}
