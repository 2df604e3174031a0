// Light that went into a ball nearby comes out here: for each channel some samples of
//     L / A = sum_i w_i E_i / sum_i w_i,    w = (2 pi x R_d / A) / p(x),    x drawn by the law with its density p,
// the estimator (22) of Liang et al. On a sphere the area within a chord d is pi d^2, as on a plane: radii are chords.
// No chord is longer than the diameter 2 R. What the law carries farther has no place on the ball: the sum of w is of
// the light within cdf(2 R / l) alone, so the rest leaves spread as that does, and under even light the ball shows A.
// xi is drawn in [0, inside] (inside.frag), so that every sample counts. Where p is the law's own density all w are
// `inside`, and the expectation is exact for any number of samples; else only in the limit of many, as in that paper.
// Both sums grow from frame to frame.
uniform vec3 alpha; // [-]
uniform vec3 mfp; // [mm]
uniform float radius; // of the ball [mm]
uniform vec3 inside; // shares of xi that draw chords < 2 radius [-]
uniform vec3 toward_light;
uniform float even; // share of the light that comes from everywhere [-]
uniform int first, count, seed;
uniform float side; // of the picture [pixels]
uniform highp usampler2D light_before, weight_before;
layout(location = 0) out uvec4 light_sum;
layout(location = 1) out uvec4 weight_sum;

// Permuted congruential generator in three dimensions (Jarzynski and Olano, JCGT 2020).
uvec3 pcg3d(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return v;
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 normal = ball_normal(gl_FragCoord.xy, side);
    vec3 tangent = normalize(cross(abs(normal.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0), normal));
    vec3 across = cross(normal, tangent);
    vec2 shift = vec2(pcg3d(uvec3(here, seed)).xy >> 8u) / 16777216.0;
    vec3 light = uintBitsToFloat(texelFetch(light_before, here, 0).rgb);
    vec3 weight = uintBitsToFloat(texelFetch(weight_before, here, 0).rgb);
    for (int c = 0; c < 3; ++c) {
        law_Shape shape = law_shape(alpha[c]);
        for (int i = first; i < first + count; ++i) {
            // The R2 sequence (Roberts), which may stop anywhere.
            vec2 point = fract(shift + float(i) * vec2(0.7548776662466927, 0.5698402909980532));
            float x = max(law_radius(inside[c] * point.x, shape), PF_LEAST_X);
            float chord = min(x * mfp[c] / radius, 2.0);
            float p = law_radius_density(x, shape);
            if (!(p > 0.0)) continue; // NaN, too: a black channel
            float angle = 6.283185307179586 * point.y;
            float away = chord * sqrt(1.0 - 0.25 * chord * chord);
            vec3 there = (1.0 - 0.5 * chord * chord) * normal + away * (cos(angle) * tangent + sin(angle) * across);
            float w = inside[c] * law_density(x, shape) / p;
            light[c] += w * irradiance(there, toward_light, even);
            weight[c] += w;
        }
    }
    light_sum = uvec4(floatBitsToUint(light), 0u);
    weight_sum = uvec4(floatBitsToUint(weight), 0u);
}
