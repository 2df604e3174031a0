// Irradiance from one patch of the sky that parts of the scene keep from points of the world.

uniform sampler2D position_map, normal_map;
uniform mat3 moment; // of the patch: integral of radiance times direction, a column by channel

out vec4 kept;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 normal = texelFetch(normal_map, here, 0).xyz, light = max(normal * moment, 0.0);
    kept = vec4(0.0);
    if (!any(greaterThan(light, vec3(0.0)))) return;
    kept.rgb = light * (1.0 - visibility(texelFetch(position_map, here, 0).xyz, normal));
}
