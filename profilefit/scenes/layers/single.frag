// Exitance with light of the first lamp that was scattered once.

uniform sampler2D scattered_map, reflectance_map, position_map, normal_map;
uniform vec3 toward_light; // in view space
uniform float perspective;

out vec4 exitance;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    exitance = texelFetch(scattered_map, here, 0);
    vec4 position = texelFetch(position_map, here, 0), surface = texelFetch(reflectance_map, here, 0);
    if (position.w < 0.5) return;
    vec3 view = perspective > 0.5 ? normalize(-position.xyz) : vec3(0.0, 0.0, 1.0);
    exitance.rgb += surface.a * added(texelFetch(normal_map, here, 0).xyz, view, toward_light, surface.rgb);
}
