// Radiance towards the camera: light that scattered, and of the first lamp light through thin parts and mirrored light.

uniform sampler2D exitance_map, irradiance_map, reflectance_map, position_map, normal_map;
uniform vec3 toward_light; // in view space
uniform float perspective;

out vec4 radiance;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(position_map, here, 0);
    vec4 normal = texelFetch(normal_map, here, 0);
    vec4 reflectance = texelFetch(reflectance_map, here, 0);
    vec3 exitance = texelFetch(exitance_map, here, 0).rgb;
    float thickness = texelFetch(irradiance_map, here, 0).a;
    float behind = max(-dot(normal.xyz, toward_light), 0.0);
    if (position.w > 0.5 && behind > 0.0) exitance += through(reflectance.rgb, thickness) * behind * light;
    vec3 colour = exitance / PI;
    if (dot(normal.xyz, normal.xyz) > 0.0) {
        vec3 view = perspective > 0.5 ? normalize(-position.xyz) : vec3(0.0, 0.0, 1.0);
        colour += mirrored(normal.xyz, view, toward_light, normal.w) * reflectance.a * light;
    }
    radiance = vec4(colour, position.w);
}
