// Irradiance from one patch of the sky that parts of the scene keep from points of the world.

uniform sampler2D position_map, normal_map;
uniform mat3 moment; // of the patch: integral of radiance times direction, a column by channel

out vec4 kept;

const float AWAY = 1.0; // from the surface, against shadows of itself: more than half a texel's diagonal [texels]

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 normal = texelFetch(normal_map, here, 0).xyz, light = max(normal * moment, 0.0);
    kept = vec4(0.0);
    if (!any(greaterThan(light, vec3(0.0)))) return;
    // One texel and no filter: many directions are averaged.
    vec3 point = texelFetch(position_map, here, 0).xyz + AWAY * shadow_pixel * normal;
    float nearest = depth_at(ivec2(floor(texel_of(point) + 0.5)));
    if (nearest < -dot(point, toward_light)) kept.rgb = light;
}
