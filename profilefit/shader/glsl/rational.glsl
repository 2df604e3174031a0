// A = t (1 - s)(1 + b s) / (1 + c s + d s^2), s = sqrt(1 - alpha); t is the share of the light that enters the surface.
float LAW_map_reflectance(float alpha) {
    float s = sqrt(max(1.0 - alpha, 0.0));
    return LAW_map_entered * (1.0 - s) * (1.0 + LAW_map_b * s) / (1.0 + s * (LAW_map_c + LAW_map_d * s));
}

// alpha / A [-], finite at alpha = 0 too
float LAW_map_alpha_over_reflectance(float alpha) {
    float s = sqrt(max(1.0 - alpha, 0.0));
    return (1.0 + s) * (1.0 + s * (LAW_map_c + LAW_map_d * s)) / (LAW_map_entered * (1.0 + LAW_map_b * s));
}

// Single-scattering albedo alpha [-] for a total reflectance A [-]: the root of a quadratic that does not cancel.
float LAW_alpha(float reflectance) {
    float share = clamp(reflectance / LAW_map_entered, 0.0, 1.0);
    float linear = 1.0 - LAW_map_b + share * LAW_map_c;
    float quadratic = LAW_map_b + share * LAW_map_d;
    float rest = 1.0 - share;
    float s = 2.0 * rest / (linear + sqrt(linear * linear + 4.0 * quadratic * rest));
    return (1.0 - s) * (1.0 + s);
}
