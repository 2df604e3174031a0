// The radius x = r/l that a uniform number draws, as a rational function of t = -ln(1 - xi):
// x = t M / (kappa M + lambda_0 - kappa),  M = 1 + a t + b t / (1 + 2.5 t) + c t^2 / (1 + 0.7 kappa t)
// One logarithm a radius. Cdf and density at a given x must look for its t: dear, but not needed to sample.

#ifndef QUANTILE_STEPS
#define QUANTILE_STEPS 5 // of Newton's method for t at x: to float32's rounding. 4 leave 2e-6 in the cdf
#endif

struct LAW_Shape {
    float reflectance; // A [-]
    float kappa; // decay rate far away [1/mfp]
    float spread; // lambda_0 - kappa, hazard at x = 0 less kappa [1/mfp]
    float a; // [-]
    float b; // [-]
    float c; // [-]
};

struct LAW_Local {
    float radius; // x [mfp]
    float slope; // dx/dt [mfp]
};

// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    s.reflectance = LAW_map_reflectance(alpha);
    s.kappa = pf_decay_rate(alpha);
    float source = LAW_source * LAW_map_alpha_over_reflectance(alpha);
    float y = 1.0 / source;
    float dark = 1.0 / (1.0 - s.kappa * y);
    float w = dark * dark;
    s.spread = source - s.kappa;
    s.a = w * (LAW_a0 + y * (LAW_a1 + y * LAW_a2));
    s.b = LAW_b0 + y * (LAW_b1 + y * y * w * LAW_b2);
    s.c = y * y * (y * (LAW_c0 + LAW_c1 * w) + LAW_c2 * w * w * w);
    return s;
}

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// x and dx/dt at t
LAW_Local LAW_local(float t, LAW_Shape s) {
    float near = 1.0 / (1.0 + 2.5 * t);
    float far = 1.0 / (1.0 + 0.7 * s.kappa * t);
    float m = 1.0 + t * (s.a + s.b * near + s.c * t * far);
    float rise = s.a + s.b * near * near + s.c * t * far * (1.0 + far); // dM/dt
    float inverse = 1.0 / (s.kappa * m + s.spread);
    LAW_Local here;
    here.radius = t * m * inverse;
    here.slope = (s.kappa * m * m + s.spread * (m + t * rise)) * inverse * inverse;
    return here;
}

// t at x, by Newton's method in ln t over ln x, a curve whose slope stays between 0.7 and 3
float LAW_depth(float radius, LAW_Shape s) {
    float x = clamp(radius, PF_NEAREST, PF_FARTHEST);
    // Next to white M is c t^2, and x goes as t^3: from x lambda_0 alone the steps would not settle there.
    float rising = x * s.spread;
    float t = s.kappa * x + min(rising, exp(log(rising / max(s.c, 1.0e-12)) * (1.0 / 3.0)));
    for (int i = 0; i < QUANTILE_STEPS; ++i) {
        LAW_Local here = LAW_local(t, s);
        t = t * exp(log(x / here.radius) * here.radius / (t * here.slope));
    }
    return t;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    float t = LAW_depth(x, s);
    LAW_Local here = LAW_local(t, s);
    return exp(-t) / here.slope;
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    return 1.0 - exp(-LAW_depth(x, s));
}

// x for a uniform number xi: the law itself
float LAW_radius(float xi, LAW_Shape s) {
    LAW_Local here = LAW_local(-pf_log1p(-clamp(xi, 0.0, PF_MOST_XI)), s);
    return here.radius;
}

// Density in x of LAW_radius [1/mfp]
float LAW_radius_density(float x, LAW_Shape s) {
    return LAW_density(x, s);
}
