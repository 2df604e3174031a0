// Under a surface that refracts light scattered once dies with the critical angle, all other light with kappa:
// 2 pi x R_d = alpha A_1 S_1 lambda_1 + (A - alpha A_1) S_2 lambda_2,  x = r/l, S and lambda as in PfCurve

#ifndef HAZARD_STEPS
#define HAZARD_STEPS 2 // of the inverse. 1 is cheaper: right to 1e-4 in xi, but density off by percents far out
#endif

struct LAW_Shape {
    float reflectance; // A [-]
    float share; // of it light scattered once [-]
    float rest; // 1 - share, which would cancel where the medium is dark
    PfCurve once;
    PfCurve again;
    float white; // of the first guess of a radius: share of what grows with e^t [-]
    float slowest; // its slope's inverse at the source [1/mfp]
};

//% shape
// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    float v = sqrt(max(1.0 - alpha, 0.0));
    float kappa = pf_decay_rate(alpha);
    float spread = LAW_b0 + v * (LAW_b1 + v * LAW_b2);
    float root = LAW_c0 + LAW_c1 * v + LAW_c2 * kappa;
    float again = LAW_map_again(alpha);
    PfCurve f;
    f.kappa = LAW_critical;
    f.source = LAW_source;
    f.w = LAW_source - LAW_critical - LAW_once_a;
    f.h = LAW_once_h;
    f.a = LAW_once_a;
    f.b = LAW_once_b;
    f.c = 0.0;
    PfCurve s;
    s.kappa = kappa;
    s.source = 0.0;
    s.a = LAW_a0 + v * (LAW_a1 + v * LAW_a2) + LAW_a3 * kappa;
    s.b = 0.5 * (spread + sqrt(spread * spread + 1e-4));
    s.c = root * root;
    s.w = min(s.c - kappa - s.a, -1e-3);
    s.h = -s.w * again * exp(-(LAW_m0 + (1.0 - alpha) * (LAW_m1 + (1.0 - alpha) * LAW_m2)));
    LAW_Shape shape;
    shape.reflectance = alpha * (LAW_map_once + alpha * again);
    shape.share = LAW_map_once / (LAW_map_once + alpha * again);
    shape.rest = alpha * again / (LAW_map_once + alpha * again);
    shape.once = f;
    shape.again = s;
    float rate = 1.2056 * sqrt(3.0873 * max(-s.w, PF_NEAREST) / s.h);
    shape.white = 0.7442 * min(rate * s.c / max(s.b, PF_NEAREST) * exp(-0.5 * s.w * s.h), 16.0);
    shape.slowest = rate * (1.0 + kappa * (2.1187 - 1.4458 * kappa));
    return shape;
}
//% end shape

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    PfLocal first = pf_local(x, s.once);
    PfLocal later = pf_local(x, s.again);
    float light = s.share * exp(-first.exponent) * first.ratio * first.hazard;
    return light + s.rest * exp(-later.exponent) * later.ratio * max(later.hazard, 0.0);
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    PfLocal first = pf_local(x, s.once);
    PfLocal later = pf_local(x, s.again);
    float left = s.share * exp(-first.exponent) * first.ratio + s.rest * exp(-later.exponent) * later.ratio;
    return clamp(1.0 - left, 0.0, 1.0);
}

// x for a uniform number xi: below the share of light scattered once that light's, else the rest's; by a guess that is
// right at both ends, and steps along sqrt(-ln S), which is smooth in x.
float LAW_radius(float xi, LAW_Shape s) {
    float share = clamp(xi, 0.0, PF_MOST_XI);
    PfCurve curve;
    curve.kappa = PF_SELECT(share < s.share, s.once.kappa, s.again.kappa);
    curve.source = PF_SELECT(share < s.share, s.once.source, s.again.source);
    curve.w = PF_SELECT(share < s.share, s.once.w, s.again.w);
    curve.h = PF_SELECT(share < s.share, s.once.h, s.again.h);
    curve.a = PF_SELECT(share < s.share, s.once.a, s.again.a);
    curve.b = PF_SELECT(share < s.share, s.once.b, s.again.b);
    curve.c = PF_SELECT(share < s.share, s.once.c, s.again.c);
    float inner = PF_SELECT(share < s.share, share / s.share, (share - s.share) / max(s.rest, PF_NEAREST));
    inner = clamp(inner, 0.0, PF_MOST_XI);
    float left = 1.0 - inner;
    float t = -pf_log1p(-inner);
    float t_first = 1.0 + 0.535 * t;
    float first = t * t_first / (s.once.kappa * t_first + max(s.once.source - s.once.kappa, PF_NEAREST));
    float growth = PF_SELECT(t < 0.01, 1.0 + 0.5 * t, (1.0 - left) / (left * max(t, 0.01)));
    float stretch = max(1.0 - s.white + 1.3479 * t + s.white * growth, 1e-3);
    float slope = max(s.again.kappa * stretch + s.slowest, 1e-3) * (1.0 + 0.456 * sqrt(t));
    float later = sqrt(t * (t + 6.1746)) * stretch / slope;
    float x = PF_SELECT(share < s.share, first, later);
    for (int i = 0; i < HAZARD_STEPS; ++i) {
        float start = clamp(x, PF_NEAREST, PF_FARTHEST);
        PfLocal here = pf_local(start, curve);
        float spent = max(here.exponent - pf_log_near_one(here.over_one, here.ratio), PF_NEAREST);
        float flight = 1.0 / max(here.hazard, PF_NEAREST);
        float beyond = sqrt(t / spent) - 1.0;
        float move = 2.0 * spent * beyond * flight;
        float y = beyond - here.bend * flight * move;
        x = max(start + move * (1.0 + y * (0.5 + y * 0.16666666666666667)), 0.0);
    }
    return x;
}

// Density in x of LAW_radius [1/mfp]: the law's own, which two steps follow to 1e-5 (relative)
float LAW_radius_density(float x, LAW_Shape s) {
    return LAW_density(x, s);
}
