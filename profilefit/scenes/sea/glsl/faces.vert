// Both triangles of each cell, with their light over their area.
flat out float light;
out vec2 old_place;  // on the surface [pixels]
out float flux;

void main() {
    int triangle = gl_VertexID / 3, corner = gl_VertexID % 3;
    ivec2 at = cell_of(triangle / 2);
    ivec2 second = triangle % 2 == 0 ? ivec2(1, 0) : ivec2(1, 1), third = triangle % 2 == 0 ? ivec2(1, 1) : ivec2(0, 1);
    vec3 a = landed(at), b = landed(at + second), c = landed(at + third);
    float cell = (side - 2.0 * margin) / float(textureSize(hit_map, 0).x);
    light = (a.z + b.z + c.z) / 3.0 / max(abs(cross2(b.xy - a.xy, c.xy - a.xy)), 1e-12);
    vec3 place = corner == 0 ? a : corner == 1 ? b : c;
    old_place = cell * vec2(at + (corner == 0 ? ivec2(0) : corner == 1 ? second : third));
    flux = place.z / (cell * cell);
    gl_Position = on_target(place.xy);
}
