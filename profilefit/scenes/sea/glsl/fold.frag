// What fell beyond the tile comes in on the other side.
uniform sampler2D splat_map;
uniform int margin;  // [pixels]
uniform int tile_side;  // [pixels]
uniform float scale;
out vec4 light;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy) + margin, size = textureSize(splat_map, 0);
    float sum = 0.0;
    int reach = (margin + tile_side - 1) / tile_side;
    for (int row = -reach; row <= reach; ++row) {
        for (int column = -reach; column <= reach; ++column) {
            ivec2 there = at + tile_side * ivec2(column, row);
            bool inside = all(greaterThanEqual(there, ivec2(0))) && all(lessThan(there, size));
            if (inside) sum += texelFetch(splat_map, there, 0).x;
        }
    }
    light = vec4(scale * sum);
}
