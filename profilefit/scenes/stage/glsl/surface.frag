// Irradiance, reflectance, position and normal of what the camera sees; how far the light came through the part.
in vec3 world_position;
in vec3 world_normal;
in vec2 texture_place;
in vec4 world_tangent; // in which u grows, and the hand of u, v and the normal; 0 where there is no relief
uniform mat4 view;
uniform mat4 light_clip;
uniform vec3 toward_light; // in the world
uniform vec3 light; // irradiance of a surface that faces it [-]
uniform vec3 ambient; // [-]
uniform sampler2D skin;
uniform sampler2D relief; // normals along the tangent, across it and outwards; a factor of the roughness
uniform sampler2D shadow_map; // depth along the light [mm]
uniform float shadow_pixel; // side of a texel [mm]
uniform float translucent;
uniform float roughness;

layout(location = 0) out vec4 irradiance_thickness;
layout(location = 1) out vec4 reflectance_visibility;
layout(location = 2) out vec4 position_mask;
layout(location = 3) out vec4 normal_roughness;
layout(location = 4) out vec4 place;

const float EMPTY = 1e5; // depth where nothing is [mm]
// In texels: out of the surface against shadows of itself, as far as the filter's slope asks; into it for the thickness.
const float OUTWARD = 2.5;
const float INWARD = 2.0;

float depth_at(ivec2 texel) {
    return texelFetch(shadow_map, clamp(texel, ivec2(0), textureSize(shadow_map, 0) - 1), 0).r;
}

vec2 texel_of(vec3 point) {
    return (0.5 + 0.5 * (light_clip * vec4(point, 1.0)).xy) * vec2(textureSize(shadow_map, 0)) - 0.5;
}

// Share of the light that arrives: a tent of two texels' half width over comparisons.
float visibility(vec3 normal) {
    vec3 point = world_position + OUTWARD * shadow_pixel * normal;
    vec2 place = texel_of(point);
    ivec2 corner = ivec2(floor(place));
    vec2 rest = place - vec2(corner);
    float depth = -dot(point, toward_light) - 0.5 * shadow_pixel;
    float seen = 0.0;
    for (int y = -1; y <= 2; ++y) {
        for (int x = -1; x <= 2; ++x) {
            vec2 tent = 2.0 - abs(vec2(x, y) - rest);
            seen += tent.x * tent.y * step(depth, depth_at(corner + ivec2(x, y)));
        }
    }
    return seen / 16.0;
}

// From where the light went in to here [mm]: linear between four texels, those that the light misses left out.
float thickness(vec3 normal) {
    vec3 point = world_position - INWARD * shadow_pixel * normal;
    vec2 place = texel_of(point);
    ivec2 corner = ivec2(floor(place));
    vec2 rest = place - vec2(corner);
    float depth = -dot(point, toward_light), total = 0.0, weight = 0.0;
    for (int y = 0; y <= 1; ++y) {
        for (int x = 0; x <= 1; ++x) {
            float there = depth_at(corner + ivec2(x, y));
            vec2 near = 1.0 - abs(vec2(x, y) - rest);
            float w = there < EMPTY ? near.x * near.y + 1e-6 : 0.0;
            total += w * max(depth - there, 0.0);
            weight += w;
        }
    }
    return weight > 0.0 ? total / weight : EMPTY;
}

vec3 bent(vec3 normal, vec3 bump) {
    vec3 along = world_tangent.xyz - dot(world_tangent.xyz, normal) * normal;
    float size = length(along);
    if (size < 1e-3) return normal;
    along /= size;
    return normalize(bump.x * along + bump.y * world_tangent.w * cross(normal, along) + bump.z * normal);
}

void main() {
    vec4 texel = texture(relief, texture_place);
    vec3 normal = bent(normalize(world_normal), texel.xyz);
    float facing = dot(normal, toward_light);
    float seen = facing > 0.0 ? visibility(normal) : 0.0;
    irradiance_thickness = vec4(light * max(facing, 0.0) * seen + ambient, thickness(normal));
    reflectance_visibility = vec4(texture(skin, texture_place).rgb, seen);
    position_mask = vec4((view * vec4(world_position, 1.0)).xyz, translucent);
    normal_roughness = vec4(mat3(view) * normal, roughness * texel.w);
    place = vec4(texture_place, 0.0, 1.0);
}
