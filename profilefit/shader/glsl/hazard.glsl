// Of the light that has come as far as x = r/l, the share lambda dx leaves in the next dx; S is what is left:
// 2 pi x R_d = A S lambda,  S = exp(-kappa x - w h V(x/h)) (1 + c x) / (1 + a x + b x^2),  V(z) = z - z^2 ln(1 + 1/z)

#ifndef HAZARD_STEPS
#define HAZARD_STEPS 2 // of the inverse. 1 is cheaper: right to 1e-4 in xi where n = 1, but density off by 1.5 % far out
#endif

struct LAW_Shape {
    float reflectance; // A [-]
    PfCurve curve;
};

//% shape
// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    PfCurve s;
    s.kappa = pf_decay_rate(alpha);
    s.source = LAW_source * LAW_map_alpha_over_reflectance(alpha);
    float root = LAW_c0 + LAW_c1 * s.source + s.kappa * (LAW_c2 + s.kappa * LAW_c3);
    s.h = exp(LAW_h0 + LAW_h1 * s.source + LAW_h2 * s.kappa);
    s.a = LAW_a0 + s.source * (LAW_a1 + s.source * LAW_a2);
    s.b = max(LAW_b0 + s.source * (LAW_b1 + s.source * LAW_b2) + LAW_b3 * s.kappa, 1e-4);
    s.c = root * root;
    s.w = s.source - s.kappa - s.a + s.c;
    LAW_Shape shape;
    shape.reflectance = LAW_map_reflectance(alpha);
    shape.curve = s;
    return shape;
}
//% end shape

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    PfLocal here = pf_local(x, s.curve);
    return exp(-here.exponent) * here.ratio * here.hazard;
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    PfLocal here = pf_local(x, s.curve);
    return clamp(1.0 - exp(-here.exponent) * here.ratio, 0.0, 1.0);
}

// x for a uniform number xi: a guess that is right at both ends, and steps that follow the hazard.
float LAW_radius(float xi, LAW_Shape s) {
    float share = clamp(xi, 0.0, PF_MOST_XI);
    float t = -pf_log1p(-share);
    float rise = s.curve.source - s.curve.kappa;
    float white = 0.27 * (rise / s.curve.source) * (rise / s.curve.source);
    float odds = share / ((1.0 - share) * max(t, PF_NEAREST));
    float stretch = 1.0 - white + 0.43 * t + white * odds;
    float x = t * stretch / (s.curve.kappa * stretch + rise);
    for (int i = 0; i < HAZARD_STEPS; ++i) {
        float start = clamp(x, PF_NEAREST, PF_FARTHEST);
        PfLocal here = pf_local(start, s.curve);
        float flight = 1.0 / here.hazard;
        float move = (t - here.exponent + pf_log_near_one(here.over_one, here.ratio)) * flight;
        float y = -here.bend * flight * move;
        x = max(start + move * (1.0 + y * (0.5 + y * 0.16666666666666667)), 0.0);
    }
    return x;
}

// Density in x of LAW_radius [1/mfp]: the law's own, which two steps follow to 1e-5 (relative)
float LAW_radius_density(float x, LAW_Shape s) {
    return LAW_density(x, s);
}
