// Three edges of each cell as lines. Each has a third of the light of both its triangles, divided by the fragments that
// it draws; or one brightness for all, as published.
const float STEEPEST = 0.98;
uniform bool shared_out;
flat out float light;

void main() {
    int edge = gl_VertexID / 2, kind = edge % 3;
    ivec2 at = cell_of(edge / 3);
    ivec2 along = kind == 0 ? ivec2(1, 0) : kind == 1 ? ivec2(0, 1) : ivec2(1, 1);
    vec3 a = landed(at), b = landed(at + along);
    // The third corners of the two triangles that share the edge.
    ivec2 left = kind == 0 ? ivec2(1, 1) : kind == 1 ? ivec2(1, 1) : ivec2(1, 0);
    ivec2 right = kind == 0 ? ivec2(0, -1) : kind == 1 ? ivec2(-1, 0) : ivec2(0, 1);
    float energy = (2.0 * (a.z + b.z) + landed(at + left).z + landed(at + right).z) / 18.0;
    if (!shared_out) {
        light = 1.0;
        gl_Position = on_target(gl_VertexID % 2 == 0 ? a.xy : b.xy);
        return;
    }
    // As many fragments as borders between pixels are passed along the longer axis, but 1 at least. Ends are moved
    // to the middles of pixels, where OpenGL leaves no doubt: it draws the first and not the last.
    vec2 way = b.xy - a.xy;
    bool lies = abs(way.x) >= abs(way.y);
    vec2 start = lies ? a.xy : a.yx, end = lies ? b.xy : b.yx;
    if (start.x > end.x) {
        vec2 other = start;
        start = end;
        end = other;
    }
    float first = round(start.x), last = round(end.x), count = last - first;
    if (count < 1.0) {
        start = floor(0.5 * (start + end)) + 0.5;
        end = start + vec2(1.0, 0.0);
        count = 1.0;
    } else {
        // Nor must it be in doubt which axis is the longer one.
        float rise = clamp((end.y - start.y) / (end.x - start.x), -STEEPEST, STEEPEST);
        vec2 middle = 0.5 * (start + end);
        start = vec2(first + 0.5, middle.y + (first + 0.5 - middle.x) * rise);
        end = vec2(last + 0.5, middle.y + (last + 0.5 - middle.x) * rise);
    }
    light = energy / count;
    vec2 place = gl_VertexID % 2 == 0 ? start : end;
    gl_Position = on_target(lies ? place : place.yx);
}
