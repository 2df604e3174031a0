// Exact light from tables, of which a shape is a row.

uniform sampler2D LAW_drawn; // ln(x / t) over t = -ln(1 - xi), even
uniform sampler2D LAW_known; // ln density and -ln(1 - cdf) over u, x = near sinh u, even
const float LAW_reflectances[@ROWS@] = float[](@REFLECTANCES@);

struct LAW_Shape {
    int row;
};

float LAW_reflectance(LAW_Shape s) {
    return LAW_reflectances[s.row];
}

// Linear between two columns, in float32: a GPU's own filter has 8 bits.
vec2 LAW_between(sampler2D table, float share, int row) {
    int last = textureSize(table, 0).x - 1;
    float place = clamp(share, 0.0, 1.0) * float(last);
    int column = min(int(place), last - 1);
    vec2 low = texelFetch(table, ivec2(column, row), 0).xy;
    vec2 high = texelFetch(table, ivec2(column + 1, row), 0).xy;
    return mix(low, high, place - float(column));
}

vec2 LAW_at(float x, LAW_Shape s) {
    float y = x / @NEAR@;
    return LAW_between(LAW_known, log(y + sqrt(y * y + 1.0)) / @LARGEST_U@, s.row);
}

float LAW_density(float x, LAW_Shape s) {
    return exp(LAW_at(x, s).x);
}

float LAW_cumulated(float x, LAW_Shape s) {
    return 1.0 - exp(-LAW_at(x, s).y);
}

float LAW_radius(float xi, LAW_Shape s) {
    float t = -log(1.0 - clamp(xi, 0.0, 0.99999994));
    return t * exp(LAW_between(LAW_drawn, t / @MOST_DEPTH@, s.row).x);
}

float LAW_radius_density(float x, LAW_Shape s) {
    return LAW_density(x, s);
}
