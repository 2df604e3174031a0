// Light comes out where it went in.

uniform sampler2D irradiance_map, reflectance_map, position_map;

out vec4 exitance;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 light = texelFetch(reflectance_map, here, 0).rgb * texelFetch(irradiance_map, here, 0).rgb;
    exitance = vec4(light, texelFetch(position_map, here, 0).w);
}
