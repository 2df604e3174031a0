// The better dipole (d'Eon 2012): R_d = t alpha^2 (C_phi phi + C_E E), fluence phi and flux E of a source at depth 1
// less those of its image at z_v = 1 + LAW_lift D, D = (2 - alpha) / 3, sigma = sqrt((1 - alpha) / D), x = r/l, t the
// share of the light that enters. Its reflectance is its own; light scattered once is not in it, and no half space has
// its finite R_d(0).

struct LAW_Shape {
    float reflectance; // A, the law's own [-]
    float sigma; // [1/mfp]
    float image; // z_v [mfp]
    float fluence; // C_phi / D [1/mfp]
    float total; // A / (t alpha^2) [-]
};

// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    float diffusion = (2.0 - alpha) / 3.0;
    s.sigma = sqrt(max((1.0 - alpha) / diffusion, 0.0));
    s.image = 1.0 + LAW_lift * diffusion;
    s.fluence = LAW_c_phi / diffusion;
    float through = exp(-s.sigma) + exp(-s.sigma * s.image);
    s.total = 0.5 * (s.fluence * pf_decayed(1.0, s.image - 1.0, s.sigma) + LAW_c_e * through);
    s.reflectance = LAW_entered * alpha * alpha * s.total;
    return s;
}

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    float r = min(x, PF_FARTHEST);
    float through = pf_flux(r, 1.0, s.sigma) + pf_flux(r, s.image, s.sigma);
    return 0.5 * r * (s.fluence * pf_fluence(r, s.image, s.sigma) + LAW_c_e * through) / s.total;
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    float r = min(x, PF_FARTHEST);
    float through = pf_flux_within(r, 1.0, s.sigma) + pf_flux_within(r, s.image, s.sigma);
    return min((s.fluence * pf_fluence_within(r, s.image, s.sigma) + LAW_c_e * through) / s.total, 1.0);
}
