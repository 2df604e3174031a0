// Irradiance by the first lamp, reflectance, position and normal of what the camera sees; how far the light came
// through the part.
in vec3 world_position;
in vec3 world_normal;
in vec2 texture_place;
in vec4 world_tangent; // in which u grows, and the hand of u, v and the normal; 0 where there is no relief
in vec3 own_tint; // factor of the reflectance
uniform mat4 view;
uniform vec3 light; // irradiance of a surface that faces it [-]
uniform sampler2D skin;
uniform sampler2D relief; // normals along the tangent, across it and outwards; a factor of the roughness
uniform float translucent;
uniform float roughness;

layout(location = 0) out vec4 irradiance_thickness;
layout(location = 1) out vec4 reflectance_visibility;
layout(location = 2) out vec4 position_mask;
layout(location = 3) out vec4 normal_roughness;
layout(location = 4) out vec4 place;

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
    float seen = facing > 0.0 ? visibility(world_position, normal) : 0.0;
    irradiance_thickness = vec4(light * max(facing, 0.0) * seen, thickness(world_position, normal));
    reflectance_visibility = vec4(texture(skin, texture_place).rgb * own_tint, seen);
    position_mask = vec4((view * vec4(world_position, 1.0)).xyz, translucent);
    normal_roughness = vec4(mat3(view) * normal, roughness * texel.w);
    place = vec4(texture_place, 0.0, 1.0);
}
