// The sum so far, and a Gaussian more.

uniform sampler2D sum_map, light_map;
uniform vec3 weight;
out vec4 sum;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 light = texelFetch(light_map, here, 0);
    sum = vec4(texelFetch(sum_map, here, 0).rgb + weight * light.rgb, light.w);
}
