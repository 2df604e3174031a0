// alpha = p A / (A^2 + q A + w) (Liang et al., equation 8). It rises up to A = sqrt(w) only; its inverse stops there.
float LAW_map_reflectance(float alpha) {
    float lean = 0.5 * (LAW_map_p - LAW_map_q * alpha);
    float rest = sqrt(max(lean * lean - LAW_map_w * alpha * alpha, 0.0));
    return min(alpha * LAW_map_w / (lean + rest), LAW_map_fold);
}

// Reduced albedo alpha [-] for a total reflectance A [-]
float LAW_alpha(float reflectance) {
    float share = clamp(reflectance, 0.0, LAW_MAX_REFLECTANCE);
    return min(LAW_map_p * share / (LAW_map_w + share * (share + LAW_map_q)), 1.0);
}
