// A vertex brings its cell's light to one pixel.
flat out float light;

void main() {
    vec3 place = landed(cell_of(gl_VertexID));
    light = place.z;
    gl_Position = on_target(place.xy);
}
