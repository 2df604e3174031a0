// Radiance towards the camera by another lamp: light through thin parts, and light that the surface mirrors.

uniform sampler2D reflectance_map, position_map, normal_map;
uniform mat4 to_world; // from view space
uniform float perspective;

out vec4 radiance;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(position_map, here, 0), normal_roughness = texelFetch(normal_map, here, 0);
    radiance = vec4(0.0);
    if (dot(normal_roughness.xyz, normal_roughness.xyz) == 0.0) return;
    vec3 point = (to_world * vec4(position.xyz, 1.0)).xyz, normal = mat3(to_world) * normal_roughness.xyz;
    vec3 view = mat3(to_world) * (perspective > 0.5 ? normalize(-position.xyz) : vec3(0.0, 0.0, 1.0));
    float facing = dot(normal, toward_light);
    if (position.w > 0.5 && facing < 0.0) {
        vec3 surface = texelFetch(reflectance_map, here, 0).rgb;
        radiance.rgb += through(surface, thickness(point, normal)) * -facing * light / PI;
    }
    float seen = facing > 0.0 ? visibility(point, normal) : 0.0;
    radiance.rgb += mirrored(normal, view, toward_light, normal_roughness.w) * seen * light;
}
