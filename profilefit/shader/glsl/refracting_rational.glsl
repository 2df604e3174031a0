// A = t (1 - rho) R / (1 - rho R), R = (1 - s)(1 + b s + f s^2) / (1 + c s + d s^2), s = sqrt(1 - alpha); t is the share of
// the light that enters, rho that of cosine-weighted light from inside which the surface reflects back.
// A / alpha = p (1 + b s + f s^2) / ((1 + s) G(s)); at alpha = 0 it is once, by light scattered once, which b follows from.
const float LAW_map_p = LAW_MAX_REFLECTANCE * (1.0 - LAW_map_trapped);
const float LAW_map_b = 2.0 * LAW_map_once / LAW_map_p * (1.0 + LAW_map_c + LAW_map_d) - 1.0 - LAW_map_f;
const float LAW_map_g0 = 1.0 - LAW_map_trapped;
const float LAW_map_g1 = LAW_map_c - LAW_map_trapped * (LAW_map_b - 1.0);
const float LAW_map_g2 = LAW_map_d - LAW_map_trapped * (LAW_map_f - LAW_map_b);
const float LAW_map_g3 = LAW_map_trapped * LAW_map_f;
// Light scattered twice and more: alpha^2 M(s) / ((1 + s)^2 G(s))
const float LAW_map_m0 = LAW_map_p - LAW_map_once * LAW_map_g0;
const float LAW_map_m1 = LAW_map_m0 + LAW_map_p * LAW_map_b - LAW_map_once * (LAW_map_g0 + LAW_map_g1);
const float LAW_map_m2 = LAW_map_m1 + LAW_map_p * LAW_map_f - LAW_map_once * (LAW_map_g1 + LAW_map_g2);
const float LAW_map_m3 = LAW_map_once * LAW_map_g3;

float LAW_map_below(float s) {
    return (1.0 + s) * (LAW_map_g0 + s * (LAW_map_g1 + s * (LAW_map_g2 + s * LAW_map_g3)));
}

// alpha / A [-], finite at alpha = 0 too
float LAW_map_alpha_over_reflectance(float alpha) {
    float s = sqrt(max(1.0 - alpha, 0.0));
    return LAW_map_below(s) / (LAW_map_p * (1.0 + s * (LAW_map_b + LAW_map_f * s)));
}

float LAW_map_reflectance(float alpha) {
    return alpha / LAW_map_alpha_over_reflectance(alpha);
}

// The reflectance by light scattered twice and more, over alpha^2 [-]
float LAW_map_again(float alpha) {
    float s = sqrt(max(1.0 - alpha, 0.0));
    return (LAW_map_m0 + s * (LAW_map_m1 + s * (LAW_map_m2 + s * LAW_map_m3))) / ((1.0 + s) * LAW_map_below(s));
}

// x >= 0 with rest = linear x + quadratic x^2 + f x^3: the root of the quadratic, and Newton's method
float LAW_map_root(float rest, float linear_term, float quadratic) {
    float x = 2.0 * rest / (linear_term + sqrt(max(linear_term * linear_term + 4.0 * quadratic * rest, 0.0)));
    for (int i = 0; i < 6; ++i) {
        float over = x * (linear_term + x * (quadratic + x * LAW_map_f)) - rest;
        x -= over / (linear_term + x * (2.0 * quadratic + 3.0 * LAW_map_f * x));
    }
    return x;
}

// Reduced albedo alpha [-] for a total reflectance A [-]: the root s where A is large, and 1 - s where it is
// small, so that neither cancels.
float LAW_alpha(float reflectance) {
    float share = clamp(reflectance / LAW_MAX_REFLECTANCE, 0.0, 1.0);
    float inside = 1.0 - LAW_map_trapped * (1.0 - share);
    float light = share / inside;
    float dark = (1.0 - LAW_map_trapped) * (1.0 - share) / inside;
    float s = LAW_map_root(dark, 1.0 - LAW_map_b + light * LAW_map_c, LAW_map_b - LAW_map_f + light * LAW_map_d);
    float slope = 1.0 + LAW_map_b + LAW_map_f + light * (LAW_map_c + 2.0 * LAW_map_d);
    float bend = -(LAW_map_b + 2.0 * LAW_map_f + light * LAW_map_d);
    float y = LAW_map_root(light * (1.0 + LAW_map_c + LAW_map_d), slope, bend);
    return PF_SELECT(share < 0.5, y * (2.0 - y), (1.0 - s) * (1.0 + s));
}
