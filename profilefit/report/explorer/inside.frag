// The share of xi in [0, 1] that draws radii x < d at which the law has light: what ball.frag draws from. For a sampler
// that inverts the law's cdf it is cdf(d); a sampler that was fitted on its own, or clips at a largest radius, has
// another one, so it is sought in the sampler itself.
precision highp int;
uniform highp sampler2D arguments; // d [mfp], alpha [-]
out uvec4 found; // bits of the share [-]

const int HALVINGS = 30;

void main() {
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    law_Shape shape = law_shape(q.y);
    float low = 0.0, high = 1.0;
    for (int i = 0; i < HALVINGS; ++i) {
        float middle = 0.5 * (low + high);
        float x = max(law_radius(middle, shape), PF_LEAST_X);
        bool inside = x < q.x && law_radius_density(x, shape) > 0.0 && law_density(x, shape) > 0.0;
        if (inside) low = middle; else high = middle;
    }
    found = uvec4(floatBitsToUint(low), 0u, 0u, 0u);
}
