// Normalized diffusion of a material with the falloff rate q = s.rate: 2 pi x R_d = A q (exp(-q x) + exp(-q x / 3)) / 4

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    float third = exp(-s.rate * x / 3.0);
    return 0.25 * s.rate * third * (1.0 + third * third);
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    float third = exp(-s.rate * x / 3.0);
    return 1.0 - third * (0.75 + 0.25 * third * third);
}

// x for a uniform number xi: the cdf's exact inverse (Golubev)
float LAW_radius(float xi, LAW_Shape s) {
    float u = 1.0 - clamp(xi, 0.0, PF_MOST_XI);
    float g = 1.0 + 4.0 * u * (2.0 * u + sqrt(1.0 + 4.0 * u * u));
    float root = exp(log(g) / 3.0); // a cube root
    return 3.0 * max(log((1.0 + 1.0 / root + root) / (4.0 * u)), 0.0) / s.rate;
}

// Density in x of LAW_radius [1/mfp]
float LAW_radius_density(float x, LAW_Shape s) {
    return LAW_density(x, s);
}
