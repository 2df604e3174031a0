// The standard dipole (Jensen et al. 2001): R_d = t alpha / (4 pi) sum over z of z (1 + sigma d) exp(-sigma d) / d^3,
// d^2 = x^2 + z^2, z = 1 and LAW_image, sigma = sqrt(3 (1 - alpha)), t the share of the light that enters, x = r/l.
// Its reflectance is its own, t alpha (exp(-sigma) + exp(-sigma LAW_image)) / 2; no half space has its finite R_d(0).

struct LAW_Shape {
    float reflectance; // A, the law's own [-]
    float sigma; // [1/mfp]
    float total; // A / (t alpha) [-]
};

// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    s.sigma = sqrt(max(3.0 * (1.0 - alpha), 0.0));
    s.total = 0.5 * (exp(-s.sigma) + exp(-s.sigma * LAW_image));
    s.reflectance = LAW_entered * alpha * s.total;
    return s;
}

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    float r = min(x, PF_FARTHEST);
    return 0.5 * r * (pf_flux(r, 1.0, s.sigma) + pf_flux(r, LAW_image, s.sigma)) / s.total;
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    float r = min(x, PF_FARTHEST);
    return min((pf_flux_within(r, 1.0, s.sigma) + pf_flux_within(r, LAW_image, s.sigma)) / s.total, 1.0);
}
