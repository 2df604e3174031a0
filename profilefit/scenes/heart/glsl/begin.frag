// Light of the atlas, and 1 where there is a surface.

uniform sampler2D irradiance_map, stretch_map;
out vec4 light;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    light = texelFetch(stretch_map, here, 0).z * vec4(texelFetch(irradiance_map, here, 0).rgb, 1.0);
}
