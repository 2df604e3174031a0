// Light of another lamp that was scattered once, to be added to exitance.

uniform sampler2D reflectance_map, position_map, normal_map;
uniform mat4 to_world; // from view space
uniform float perspective;

out vec4 exitance;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(position_map, here, 0);
    exitance = vec4(0.0);
    if (position.w < 0.5) return;
    vec3 point = (to_world * vec4(position.xyz, 1.0)).xyz;
    vec3 normal = mat3(to_world) * texelFetch(normal_map, here, 0).xyz;
    vec3 view = mat3(to_world) * (perspective > 0.5 ? normalize(-position.xyz) : vec3(0.0, 0.0, 1.0));
    vec3 found = added(normal, view, toward_light, texelFetch(reflectance_map, here, 0).rgb);
    if (found != vec3(0.0)) exitance.rgb = visibility(point, normal) * found;
}
