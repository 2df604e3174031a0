// alpha = 1 - s^2,  s = p0 + p1 A - sqrt(q0 + q1 A + q2 A^2) (van de Hulst, as Kulla and Conty invert him)
float LAW_map_reflectance(float alpha) {
    float rest = LAW_map_p0 - sqrt(max(1.0 - alpha, 0.0));
    float slope = 2.0 * LAW_map_p1 * rest - LAW_map_q1;
    float constant = rest * rest - LAW_map_q0;
    float root = sqrt(max(slope * slope - 4.0 * (LAW_map_p1 * LAW_map_p1 - LAW_map_q2) * constant, 0.0));
    return clamp(2.0 * constant / (root - slope), 0.0, 1.0);
}

// Reduced albedo alpha [-] for a total reflectance A [-]
float LAW_alpha(float reflectance) {
    float share = clamp(reflectance, 0.0, LAW_MAX_REFLECTANCE);
    float s = LAW_map_p0 + LAW_map_p1 * share - sqrt(LAW_map_q0 + share * (LAW_map_q1 + share * LAW_map_q2));
    return clamp((1.0 - s) * (1.0 + s), 0.0, 1.0);
}
