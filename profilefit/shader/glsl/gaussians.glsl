// R_d = A sum_i w_i exp(-x^2 / 2 v_i) / (2 pi v_i),  cdf = 1 - sum_i w_i exp(-x^2 / 2 v_i),  x = r/l

#ifndef GAUSSIANS_STEPS
#define GAUSSIANS_STEPS 10 // of Newton's method for the radius. 8 are enough for six Gaussians fitted to a half space
#endif

struct LAW_Shape {
    float reflectance; // A [-]
//% for 1
    float rate@i; // 1 / 2 v_@i [1/mfp^2]
    float weight@i; // w_@i [-]
//% end
};

//% shape
// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    s.reflectance = LAW_map_reflectance(alpha);
    float dark = sqrt(max(1.0 - alpha, 0.0));
    float level1 = LAW_v1 + dark * (LAW_f1 + dark * LAW_f2); // ln v_1
    float logit1 = 0.0 * dark; // ln w_1 / w_1
    float top = logit1;
//% for 2
    float level@i = level@h + LAW_rise@i; // rise ln(1 + e^v@i)
    float logit@i = LAW_w@i0 + LAW_w@i1 * dark;
    top = max(top, logit@i);
//% end
    float sum = 0.0;
//% for 1
    s.rate@i = 0.5 * exp(-level@i);
    s.weight@i = exp(logit@i - top);
    sum = sum + s.weight@i;
//% end
//% for 1
    s.weight@i = s.weight@i / sum;
//% end
    return s;
}
//% end shape

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    float r = min(x, PF_FARTHEST);
    float sum = 0.0;
//% for 1
    sum = sum + s.weight@i * s.rate@i * exp(-s.rate@i * r * r);
//% end
    return 2.0 * r * sum;
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    float r = min(x, PF_FARTHEST);
    float sum = 0.0;
//% for 1
    sum = sum + s.weight@i * (1.0 - exp(-s.rate@i * r * r));
//% end
    return min(sum, 1.0);
}

// x for a uniform number xi: Newton's method for q = x^2, from the left on a curve that is convex. No Gaussian alone is
// more than what is left, which gives the start.
float LAW_radius(float xi, LAW_Shape s) {
    float left = 1.0 - clamp(xi, 0.0, PF_MOST_XI);
    float q = 0.0;
//% for 1
    q = max(q, log(max(s.weight@i / left, PF_NEAREST)) / s.rate@i);
//% end
    for (int i = 0; i < GAUSSIANS_STEPS; ++i) {
        float sum = 0.0;
        float slope = 0.0;
        float term = 0.0;
//% for 1
        term = s.weight@i * exp(-s.rate@i * q);
        sum = sum + term;
        slope = slope + term * s.rate@i;
//% end
        q = q + max(sum * log(sum / left) / slope, 0.0);
    }
    return sqrt(q);
}

// Density in x of LAW_radius [1/mfp]
float LAW_radius_density(float x, LAW_Shape s) {
    return LAW_density(x, s);
}
