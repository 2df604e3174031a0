// The scene as the light sees it: the depth along the light [mm].
in vec3 position;
uniform mat4 light_clip;
uniform vec3 toward_light; // in the world
out float depth;

void main() {
    gl_Position = light_clip * vec4(position, 1.0);
    depth = -dot(position, toward_light);
}
