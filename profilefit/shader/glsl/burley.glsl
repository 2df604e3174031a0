// Normalized diffusion: 2 pi x R_d = A q (exp(-q x) + exp(-q x / 3)) / 4,  x = r/l,
// q = s(A) = s0 - s1 A + s2 |A - s3|^p, p = 3 under a searchlight and 2 under diffuse light.

struct LAW_Shape {
    float reflectance; // A [-]
    float rate; // q [1/mfp]
};

// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    s.reflectance = LAW_map_reflectance(alpha);
    float gap = abs(s.reflectance - LAW_s3);
    s.rate = LAW_s0 - LAW_s1 * s.reflectance + LAW_s2 * gap * gap * PF_SELECT(LAW_power > 2.5, gap, 1.0);
    return s;
}
