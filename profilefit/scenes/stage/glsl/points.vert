// Points of the scene, each in a pixel of its own.
in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 tangent;
in vec3 tint;
uniform vec2 sides; // columns and rows of pixels
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
    int columns = int(sides.x);
    vec2 pixel = vec2(float(gl_VertexID % columns), float(gl_VertexID / columns));
    gl_Position = vec4(2.0 * (pixel + 0.5) / sides - 1.0, 0.0, 1.0);
}
