// Normalized diffusion per diffuse mean free path l_d: 2 pi x R_d = A q (exp(-q x) + exp(-q x / 3)) / 4,  x = r/l,
// q = (s0 + s1 (A - s2)^4) l / l_d,  l / l_d = sqrt(3 (1 - alpha) / (2 - alpha)). For alpha < 1: at alpha = 1 l_d has
// no end, and the law is 1e7 mfp wide here to stay finite.

struct LAW_Shape {
    float reflectance; // A [-]
    float rate; // q [1/mfp]
};

// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    s.reflectance = LAW_map_reflectance(alpha);
    float gap = s.reflectance - LAW_s2;
    float scale = LAW_s0 + LAW_s1 * gap * gap * gap * gap;
    s.rate = max(scale * sqrt(max(3.0 * (1.0 - alpha) / (2.0 - alpha), 0.0)), 1e-7);
    return s;
}
