// Depth at which a ray from the eye leaves what it meets first.
in vec3 world_position;
uniform mat4 view;

out float depth;

void main() {
    if (gl_FrontFacing) discard;
    depth = -(view * vec4(world_position, 1.0)).z;
}
