#ifndef PF_NEAR_ZERO
#define PF_NEAR_ZERO
// ln(whole), whole = 1 + t: a series where |t| < 0.1, for there log may be off by 2^-21, says OpenGL
float pf_log_near_one(float t, float whole) {
    float z = clamp(t, -0.1, 0.1);
    z = z / (2.0 + z);
    float q = z * z;
    float series = 1.0 + q * (1.0 / 3.0 + q * (1.0 / 5.0 + q * (1.0 / 7.0 + q * (1.0 / 9.0))));
    return PF_SELECT(abs(t) < 0.1, 2.0 * z * series, log(max(whole, PF_NEAREST)));
}

// ln(1 + t) without the rounding of 1 + t
float pf_log1p(float t) {
    return pf_log_near_one(t, 1.0 + t);
}

// (1 - exp(-t)) / t, the mean of exp(-t) from 0 to t >= 0: a series where t < 0.25
float pf_mean_decay(float t) {
    float q = min(t, 0.25);
    float tail = 1.0 - q / 5.0 * (1.0 - q / 6.0 * (1.0 - q / 7.0 * (1.0 - q / 8.0 * (1.0 - q / 9.0))));
    float series = 1.0 - q / 2.0 * (1.0 - q / 3.0 * (1.0 - q / 4.0 * tail));
    float far = max(t, 0.25);
    return PF_SELECT(t < 0.25, series, (1.0 - exp(-far)) / far);
}
#endif
