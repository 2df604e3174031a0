// The rectangle of all pixels that a cell's two triangles touch.
const float LEAST = 2e-3, WIDER = 0.05;  // of cells.frag [pixels^2, pixels]
flat out vec4 first;  // corners [pixels]
flat out vec4 last;
flat out vec2 light;  // of the triangles first.xy, first.zw, last.xy and first.xy, last.xy, last.zw

void main() {
    int corner = gl_VertexID % 6;
    ivec2 at = cell_of(gl_VertexID / 6);
    vec3 a = landed(at), b = landed(at + ivec2(1, 0)), c = landed(at + ivec2(1, 1)), d = landed(at + ivec2(0, 1));
    first = vec4(a.xy, b.xy);
    last = vec4(c.xy, d.xy);
    light = vec2(a.z + b.z + c.z, a.z + c.z + d.z) / 6.0;
    vec2 low = floor(min(min(a.xy, b.xy), min(c.xy, d.xy))), high = ceil(max(max(a.xy, b.xy), max(c.xy, d.xy)));
    high = max(high, low + 1.0);
    if (min(abs(cross2(b.xy - a.xy, c.xy - a.xy)), abs(cross2(c.xy - a.xy, d.xy - a.xy))) < LEAST) {
        // A thin triangle is drawn wider, and may touch one more.
        low = min(low, floor(min(min(a.xy, b.xy), min(c.xy, d.xy)) - WIDER));
        high = max(high, ceil(max(max(a.xy, b.xy), max(c.xy, d.xy)) + WIDER));
    }
    bool right = corner == 1 || corner == 2 || corner == 4, up = corner == 2 || corner == 4 || corner == 5;
    gl_Position = on_target(vec2(right ? high.x : low.x, up ? high.y : low.y));
}
