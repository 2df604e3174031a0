#ifndef PF_SURVIVAL
#define PF_SURVIVAL
// Of the light that has come as far as x = r/l, the share lambda dx leaves in the next dx; S is what is left:
// S = exp(-kappa x - w h V(x/h)) (1 + c x) / (1 + a x + b x^2),  lambda = -S'/S,  V(z) = z - z^2 ln(1 + 1/z)
struct PfCurve {
    float kappa; // decay rate far away [1/mfp]
    float source; // lambda at x = 0 [1/mfp]
    float w; // [1/mfp]
    float h; // [mfp]
    float a; // [1/mfp]
    float b; // [1/mfp^2]
    float c; // [1/mfp]
};

struct PfLocal {
    float exponent; // S = exp(-exponent) ratio
    float ratio;
    float over_one; // ratio - 1
    float hazard; // lambda [1/mfp]
    float bend; // d lambda / dx [1/mfp^2]
};

PfLocal pf_local(float radius, PfCurve s) {
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
    // spent - (q rest)^2, which vanishes at both ends: times q, a last digit of q rest would be without bound.
    float turn = PF_SELECT(q < 0.1, slope - p * rest * p * rest, rest * (3.0 - rest) - 2.0 * log_term);
    float up = (s.a + 2.0 * s.b * x) * over_n;
    float down = s.c * over_d;
    PfLocal here;
    here.exponent = s.kappa * x + s.w * s.h * early;
    here.ratio = denominator * over_n;
    here.over_one = x * (s.c - s.a - s.b * x) * over_n;
    here.hazard = s.kappa + s.w * spent + up - down;
    here.bend = s.w * q * turn / s.h + 2.0 * s.b * over_n - up * up + down * down;
    return here;
}
#endif
