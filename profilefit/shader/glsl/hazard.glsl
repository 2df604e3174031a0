// Of the light that has come as far as x = r/l, the share lambda dx leaves in the next dx; S is what is left:
// 2 pi x R_d = A S lambda,  S = exp(-kappa x - w h V(x/h)) (1 + c x) / (1 + a x + b x^2),  V(z) = z - z^2 ln(1 + 1/z)

#ifndef HAZARD_STEPS
#define HAZARD_STEPS 2 // of the inverse. 1 is cheaper: right to 1e-4 in xi where n = 1, but density off by 1.5 % far out
#endif

struct LAW_Shape {
    float reflectance; // A [-]
    float kappa; // decay rate far away [1/mfp]
    float source; // lambda at x = 0 [1/mfp]
    float w; // [1/mfp]
    float h; // [mfp]
    float a; // [1/mfp]
    float b; // [1/mfp^2]
    float c; // [1/mfp]
};

struct LAW_Local {
    float exponent; // S = exp(-exponent) ratio
    float ratio;
    float hazard; // lambda [1/mfp]
    float bend; // d lambda / dx [1/mfp^2]
};

// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    s.reflectance = LAW_map_reflectance(alpha);
    s.kappa = pf_decay_rate(alpha);
    s.source = LAW_source * LAW_map_alpha_over_reflectance(alpha);
    float root = LAW_c0 + LAW_c1 * s.source + LAW_c2 * s.kappa;
    s.h = exp(LAW_h0 + LAW_h1 * s.source + LAW_h2 * s.kappa);
    s.a = LAW_a0 + s.source * (LAW_a1 + s.source * LAW_a2);
    s.b = max(LAW_b0 + s.source * (LAW_b1 + s.source * LAW_b2), 1e-4);
    s.c = root * root;
    s.w = s.source - s.kappa - s.a + s.c;
    return s;
}

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

LAW_Local LAW_local(float radius, LAW_Shape s) {
    float x = clamp(radius, PF_NEAREST, PF_FARTHEST);
    float q = s.h / x;
    float numerator = 1.0 + x * (s.a + x * s.b);
    float denominator = 1.0 + s.c * x;
    float over_n = 1.0 / numerator;
    float over_d = 1.0 / denominator;
    float rest = 1.0 / (1.0 + q);
    // V and V' at z = 1/q. Where z is large they cancel, and their series take over.
    float z = x / s.h;
    float log_term = z * log(1.0 + q);
    float p = min(q, 0.1);
    float series = 0.5 - p * (0.3333333333333333 - p * (0.25 - p * (0.2 - p * (0.16666666666666667 - p * 0.14285714285714285))));
    float slope = p * p * (0.3333333333333333 - p * (0.5 - p * (0.6 - p * (0.6666666666666667 - p * 0.7142857142857143))));
    float early = PF_SELECT(q < 0.1, series, z * (1.0 - log_term));
    float spent = PF_SELECT(q < 0.1, slope, 1.0 - 2.0 * log_term + rest);
    float up = (s.a + 2.0 * s.b * x) * over_n;
    float down = s.c * over_d;
    LAW_Local here;
    here.exponent = s.kappa * x + s.w * s.h * early;
    here.ratio = denominator * over_n;
    here.hazard = s.kappa + s.w * spent + up - down;
    here.bend = s.w * q * (spent - q * rest * q * rest) / s.h + 2.0 * s.b * over_n - up * up + down * down;
    return here;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    LAW_Local here = LAW_local(x, s);
    return exp(-here.exponent) * here.ratio * here.hazard;
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    LAW_Local here = LAW_local(x, s);
    return clamp(1.0 - exp(-here.exponent) * here.ratio, 0.0, 1.0);
}

// x for a uniform number xi: a guess that is right at both ends, and steps that follow the hazard.
float LAW_radius(float xi, LAW_Shape s) {
    float share = clamp(xi, 0.0, PF_MOST_XI);
    float t = -log(1.0 - share);
    float rise = s.source - s.kappa;
    float white = 0.27 * (rise / s.source) * (rise / s.source);
    float odds = share / ((1.0 - share) * max(t, PF_NEAREST));
    float stretch = 1.0 - white + 0.43 * t + white * odds;
    float x = t * stretch / (s.kappa * stretch + rise);
    for (int i = 0; i < HAZARD_STEPS; ++i) {
        float start = clamp(x, PF_NEAREST, PF_FARTHEST);
        LAW_Local here = LAW_local(start, s);
        float flight = 1.0 / here.hazard;
        float move = (t - here.exponent + log(here.ratio)) * flight;
        float y = -here.bend * flight * move;
        x = max(start + move * (1.0 + y * (0.5 + y * 0.16666666666666667)), 0.0);
    }
    return x;
}

// Density in x of LAW_radius [1/mfp]: the law's own, which two steps follow to 1e-5 (relative)
float LAW_radius_density(float x, LAW_Shape s) {
    return LAW_density(x, s);
}
