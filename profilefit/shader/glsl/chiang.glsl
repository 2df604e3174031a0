// alpha = 1 - exp(e1 A + e2 A^2 + e3 A^3) (Chiang, Kutz and Burley). alpha(1) is below 1; albedos beyond have A = 1.

#define CHIANG_STEPS 8

// -ln(1 - alpha) [-]
float LAW_exponent(float reflectance) {
    return -reflectance * (LAW_map_e1 + reflectance * (LAW_map_e2 + reflectance * LAW_map_e3));
}

// Newton's method inside a bracket, for a cubic that rises
float LAW_map_reflectance(float alpha) {
    float target = min(-pf_log1p(-min(alpha, 1.0)), -(LAW_map_e1 + LAW_map_e2 + LAW_map_e3));
    float low = 0.0;
    float high = 1.0;
    float middle = 0.5;
    for (int i = 0; i < CHIANG_STEPS; ++i) {
        float excess = LAW_exponent(middle) - target;
        low = PF_SELECT(excess < 0.0, middle, low);
        high = PF_SELECT(excess < 0.0, high, middle);
        float slope = -(LAW_map_e1 + middle * (2.0 * LAW_map_e2 + 3.0 * middle * LAW_map_e3));
        middle = clamp(middle - excess / slope, low, high);
    }
    return middle;
}

// Reduced albedo alpha [-] for a total reflectance A [-]
float LAW_alpha(float reflectance) {
    float t = LAW_exponent(clamp(reflectance, 0.0, LAW_MAX_REFLECTANCE));
    return t * pf_mean_decay(t);
}
