// In lengths: r and mfp in one unit, any unit.

// R_d [1/length^2]: 2 pi r R_d integrates to A
float LAW_profile(float r, float alpha, float mfp) {
    LAW_Shape s = LAW_shape(alpha);
    float x = max(r / mfp, PF_LEAST_X);
    return LAW_reflectance(s) * LAW_density(x, s) / (PF_TWO_PI * x) / (mfp * mfp);
}

// Share of the reflected energy within r [-]
float LAW_cdf(float r, float alpha, float mfp) {
    return LAW_cumulated(r / mfp, LAW_shape(alpha));
}

// Radius [length] for a uniform number xi in [0, 1]
float LAW_sample(float xi, float alpha, float mfp) {
    return LAW_radius(xi, LAW_shape(alpha)) * mfp;
}

// Density [1/length] of LAW_sample
float LAW_pdf(float r, float alpha, float mfp) {
    return LAW_radius_density(r / mfp, LAW_shape(alpha)) / mfp;
}
