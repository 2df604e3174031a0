// Irradiance by another lamp than the first.

uniform sampler2D position_map, normal_map;
uniform mat4 to_world; // from the maps' space
uniform vec3 light; // irradiance of a surface that faces it [-]

out vec4 irradiance;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 own = texelFetch(normal_map, here, 0).xyz;
    irradiance = vec4(0.0);
    if (dot(own, own) == 0.0) return;
    vec3 normal = mat3(to_world) * own;
    float facing = dot(normal, toward_light);
    if (facing <= 0.0) return;
    vec3 point = (to_world * vec4(texelFetch(position_map, here, 0).xyz, 1.0)).xyz;
    irradiance.rgb = light * facing * visibility(point, normal);
}
