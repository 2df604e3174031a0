// What a beam of sun brings to a segment of a view ray, and that to the eye, per scattering: int_0^t1 of
// e^{-c (s0 + m t)} e^{-c (t0 + t)} dt = e^{-c (s0 + t0)} t1 phi(c (1 + m) t1), phi(x) = (1 - e^-x) / x.

// phi, by phi(x) = phi(x / 2) (1 + e^{-x / 2}) / 2 below 1, where 1 - e^-x would lose digits
float segment_phi(float x) {
    float near = min(x, 1.0);
    float halved = pf_mean_decay(0.25 * near) * (0.5 + 0.5 * exp(-0.25 * near)) * (0.5 + 0.5 * exp(-0.5 * near));
    float far = max(x, 1.0);
    return PF_SELECT(x < 1.0, halved, (1.0 - exp(-far)) / far);
}

// c attenuation [1/length], s0 and t0 the way of the light to the segment's begin and from there to the eye [length],
// m the cosine of the view ray to the beam, t1 the segment's length. Finite for m = -1, which looks along the beam:
// 1 + m is exact near there, and phi(0) is 1.
float segment_integral(float c, float s0, float t0, float m, float t1) {
    float fading = c * max(1.0 + m, 0.0);
    return exp(-c * s0) * exp(-c * t0) * (t1 * segment_phi(fading * t1));
}

// The same of the optical ways c (s + t) at both ends, where the surface has turned the beam aside: from a level sea
// m is v_z over the cosine of the beam, which may be beyond 1 or -1.
float segment_between(float begin, float end, float t1) {
    return t1 * exp(-min(begin, end)) * segment_phi(abs(begin - end));
}
