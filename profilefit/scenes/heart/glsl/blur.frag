// One Gaussian along rows or columns of the atlas, as wide on the surface everywhere. Where lines draw together a surface
// spreads light otherwise than a plane: both blurs are one of the surface, to first order in their variance, if a tap
// counts by sqrt(h across / h along), h how far a texel leads. Taps are a whole number of texels apart: one, where the
// light has edges; more, where a blur before took them away.

uniform sampler2D filled_map, stretch_map;
uniform vec2 along; // (1, 0) or (0, 1)
uniform float sigma; // [mm]
uniform float before; // sigma of the blurs so far [mm]
uniform float reach; // of the taps [sigma]
uniform float widest; // sigma at most, where a texel is next to nothing [texels]
out vec4 blurred;

const float NARROW = 0.6; // [texels]
const float SMOOTH = 0.7; // taps that far apart, in sigma of what was blurred, miss nothing of it

float counts(ivec2 texel) {
    vec4 stretch = texelFetch(stretch_map, texel, 0);
    return sqrt(dot(stretch.yx, along) / max(dot(stretch.xy, along), 1e-20));
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 stretch = texelFetch(stretch_map, here, 0);
    float texel = max(dot(stretch.xy, along), 1e-20);
    float width = min(sigma / texel, widest); // [texels]
    int apart = max(1, int(min(0.5 * width, SMOOTH * min(before / texel, widest)) + 0.5));
    int taps = int(ceil(reach * width / float(apart)));
    vec4 sum = counts(here) * texelFetch(filled_map, here, 0);
    float rate = 0.5 * float(apart * apart) / max(width * width, 1e-12);
    // Samples of a Gaussian that narrow have less than its variance, and of many such blurs next to nothing is left: one
    // tap to either side has all of it.
    bool narrow = width < NARROW;
    if (narrow) taps = 1;
    ivec2 last = textureSize(filled_map, 0) - 1;
    for (int i = 1; i <= taps; ++i) {
        float weight = narrow ? 0.5 * width * width / (1.0 - width * width) : exp(-rate * float(i * i));
        ivec2 step = ivec2(along) * i * apart;
        for (int side = -1; side <= 1; side += 2) {
            ivec2 there = here + side * step;
            if (all(greaterThanEqual(there, ivec2(0))) && all(lessThanEqual(there, last))) {
                sum += weight * counts(there) * texelFetch(filled_map, there, 0);
            }
        }
    }
    blurred = stretch.z > 0.5 && sum.w > 0.0 ? sum / sum.w : vec4(0.0);
}
