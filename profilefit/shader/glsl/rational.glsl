// A = (1 - s)(1 + b s) / (1 + c s + d s^2), s = sqrt(1 - alpha)
float LAW_map_reflectance(float alpha) {
    float s = sqrt(max(1.0 - alpha, 0.0));
    // 1 - s as alpha / (1 + s): where alpha is small, the difference has no digits in float32.
    return alpha * (1.0 + LAW_map_b * s) / ((1.0 + s) * (1.0 + s * (LAW_map_c + LAW_map_d * s)));
}

// alpha / A [-], finite at alpha = 0 too
float LAW_map_alpha_over_reflectance(float alpha) {
    float s = sqrt(max(1.0 - alpha, 0.0));
    return (1.0 + s) * (1.0 + s * (LAW_map_c + LAW_map_d * s)) / (1.0 + LAW_map_b * s);
}

// Reduced albedo alpha [-] for a total reflectance A [-]: the root s of a quadratic where A is large, and
// 1 - s where it is small, so that neither cancels.
float LAW_alpha(float reflectance) {
    float share = clamp(reflectance, 0.0, LAW_MAX_REFLECTANCE);
    float bright_linear = 1.0 - LAW_map_b + share * LAW_map_c;
    float quadratic = LAW_map_b + share * LAW_map_d;
    float rest = 1.0 - share;
    float s = 2.0 * rest / (bright_linear + sqrt(bright_linear * bright_linear + 4.0 * quadratic * rest));
    float dark_linear = 1.0 + LAW_map_b + share * (LAW_map_c + 2.0 * LAW_map_d);
    float dark_rest = share * (1.0 + LAW_map_c + LAW_map_d);
    float root = sqrt(max(dark_linear * dark_linear - 4.0 * quadratic * dark_rest, 0.0));
    float t = 2.0 * dark_rest / (dark_linear + root);
    return PF_SELECT(share < 0.5, t * (2.0 - t), (1.0 - s) * (1.0 + s));
}
