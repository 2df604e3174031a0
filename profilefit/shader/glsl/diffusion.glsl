#ifndef PF_DIFFUSION
#define PF_DIFFUSION
// What dipoles share. A source at depth z and what leaves at the distance d = sqrt(x^2 + z^2) from it; sigma [1/mfp].
float pf_distance(float x, float z) {
    return sqrt(x * x + z * z);
}

// 4 pi times the flux through the surface [1/mfp^2]
float pf_flux(float x, float z, float sigma) {
    float d = pf_distance(x, z);
    return (z / d) * (1.0 / d + sigma) * exp(-sigma * d) / d;
}

// Integral of 2 pi x times the flux up to x [-]
float pf_flux_within(float x, float z, float sigma) {
    float d = pf_distance(x, z);
    float beyond = x * x / (d + z); // d - z
    float t = sigma * beyond;
    return 0.5 * exp(-sigma * z) * (exp(-t) * beyond / d + t * pf_mean_decay(t));
}

// 4 pi D times the fluence on the surface of a source at depth 1 less that of its image [1/mfp]: sorted, since far away
// the two are all but equal
float pf_fluence(float x, float image, float sigma) {
    float near = pf_distance(x, 1.0);
    float far = pf_distance(x, image);
    float gap = (image - 1.0) * (image + 1.0) / (near + far); // far - near
    return exp(-sigma * near) * gap / far * (1.0 / near + sigma * pf_mean_decay(sigma * gap));
}

// Integral of exp(-sigma t) from start over length [mfp]
float pf_decayed(float start, float length, float sigma) {
    return exp(-sigma * start) * length * pf_mean_decay(sigma * length);
}

// Integral of 2 pi x times D times that fluence up to x [mfp]: sorted for near and for far
float pf_fluence_within(float x, float image, float sigma) {
    float real = pf_distance(x, 1.0);
    float other = pf_distance(x, image);
    float near = pf_decayed(1.0, x * x / (real + 1.0), sigma) - pf_decayed(image, x * x / (other + image), sigma);
    float gap = (image - 1.0) * (image + 1.0) / (real + other);
    float far = pf_decayed(1.0, image - 1.0, sigma) - pf_decayed(real, gap, sigma);
    return 0.5 * PF_SELECT(x < 1.0, near, far);
}
#endif
