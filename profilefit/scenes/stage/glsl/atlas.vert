// The scene laid out over its texture, with a margin around it.
in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 tangent;
in vec3 tint;
uniform vec2 inset; // share of the atlas that u and v from 0 to 1 take
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
    gl_Position = vec4((2.0 * uv - 1.0) * inset, 0.0, 1.0);
}
