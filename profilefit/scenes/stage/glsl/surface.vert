// The scene as the camera sees it.
in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 tangent;
in vec3 tint;
uniform mat4 view;
uniform mat4 projection;
out vec3 world_position;
out vec3 world_normal;
out vec2 texture_place;
out vec4 world_tangent;
out vec3 own_tint;

void main() {
    world_position = position;
    world_normal = normal;
    texture_place = uv;
    world_tangent = tangent;
    own_tint = tint;
    gl_Position = projection * view * vec4(position, 1.0);
}
