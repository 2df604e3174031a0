// The scene as the camera sees it.
in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 tangent;
uniform mat4 view;
uniform mat4 projection;
out vec3 world_position;
out vec3 world_normal;
out vec2 texture_place;
out vec4 world_tangent;

void main() {
    world_position = position;
    world_normal = normal;
    texture_place = uv;
    world_tangent = tangent;
    gl_Position = projection * view * vec4(position, 1.0);
}
