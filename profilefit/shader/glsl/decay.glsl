#ifndef PF_DECAY
#define PF_DECAY
// kappa [1/mfp], the root of kappa = tanh(kappa / alpha): far away R_d falls off as exp(-kappa x) / x^2.
// Three terms of the root's series at alpha = 1, its value at alpha = 0, one step of Newton's method: 2.4e-5.
float pf_decay_rate(float alpha) {
    float q = 1.0 - alpha;
    float series = sqrt(max(q * (3.0 + q * (-2.4 + q * (0.06857142857142857 + q * 0.3314285714285714))), 0.0));
    float start = PF_SELECT(q > 0.08, series, 0.5);
    float bounded = PF_SELECT(q > 0.08, max(alpha, 1e-6), 0.9);
    float e = exp(-2.0 * min(start / bounded, 40.0)); // tanh by hand: some drivers overflow in theirs
    float t = (1.0 - e) / (1.0 + e);
    float bend = 4.0 * e / ((1.0 + e) * (1.0 + e)); // 1 - t^2 without its cancellation
    float root = start - (start - t) / (1.0 - bend / bounded);
    return PF_SELECT(q > 0.08, root, series);
}
#endif
