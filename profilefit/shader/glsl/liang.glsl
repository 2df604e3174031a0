// The laws of Liang et al.: r R_d = (a r + b) / (r + c) up to r_max = -b/a, scaled to the reflectance, and beside it an
// inverse cdf of its own, g(xi) = (k1 xi - k2) sqrt(xi) ln(1 + eps - xi), r = min(|g|, r_max). Lengths in mfp.
// Not right, and so by the paper: g is not the inverse of this cdf, so divide by LAW_radius_density, never by
// LAW_density; xi < eps = 0.01 draws radii again that are tiny; all g > r_max fall on r_max itself, an atom of up to a
// few percent that no density holds (R_d is 0 there: let its weight be 0); at alpha = 0 there is no law (0/0: 1e-6 is
// taken); and where k1 > 0.95 k2, for alpha below 1e-4 (printed) or 0.02 (regenerated), g turns back before xi = 1 and
// LAW_radius_density is finite but not its density.

#define LIANG_TURN_STEPS 4
#define LIANG_STEPS 5

struct LAW_Shape {
    float reflectance; // A [-]
    float largest; // r_max [mfp]
    float c; // [mfp]
    float total; // what (r_max + c) ln(1 + x/c) - x comes to at r_max [mfp]
    float k1; // [mfp]
    float k2; // [mfp]
    float turn; // u = sqrt(xi / eps) where |g| is largest below xi = eps [-]
    float dip; // |g| there [mfp]
};

struct LAW_Local {
    float radius; // |g| at u [mfp]
    float slope; // d|g|/du [mfp]
};

// |g| below xi = eps u^2, 0 <= u <= 1
LAW_Local LAW_local(float u, LAW_Shape s) {
    float d = LAW_eps * (1.0 - u * u);
    float ln = pf_log1p(d);
    float lever = s.k2 - s.k1 * LAW_eps * u * u;
    LAW_Local here;
    here.radius = LAW_root * lever * u * ln;
    here.slope = LAW_root * (lever * ln - 2.0 * LAW_eps * u * u * (s.k1 * ln + lever / (1.0 + d)));
    return here;
}

// All that depends on alpha only: once a material, or once a pixel where A is a texture.
LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    float bright = max(alpha, 1e-6);
    float ln = log(bright);
    float off = bright - LAW_b2;
    float a = LAW_a1 * bright + LAW_a2 * exp(2.302585092994046 * LAW_a3 * (bright - 1.0));
    float b = LAW_b0 * exp(ln * ((LAW_b1 * off * off + LAW_b3) * bright + LAW_b4));
    s.reflectance = LAW_map_reflectance(alpha);
    s.c = LAW_c1 * exp(LAW_c2 * bright) + LAW_c3;
    s.largest = b / max(-a, 1e-12);
    s.total = (s.largest + s.c) * pf_log1p(s.largest / s.c) - s.largest;
    s.k1 = LAW_g1 * exp(ln * (LAW_g2 * exp(ln * LAW_g3) + LAW_g4));
    s.k2 = LAW_h1 * exp(ln * (LAW_h2 * bright + LAW_h3));
    s.turn = 0.5773502691896258 + 0.0 * bright;
    for (int i = 0; i < LIANG_TURN_STEPS; ++i) {
        LAW_Local near = LAW_local(s.turn, s);
        s.turn = s.turn + near.slope / (3.4641016151377544 * LAW_eps * LAW_root * s.k2);
    }
    LAW_Local here = LAW_local(s.turn, s);
    s.dip = here.radius;
    return s;
}

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    return max(s.largest - x, 0.0) / ((min(x, s.largest) + s.c) * s.total);
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    float inside = min(x, s.largest);
    return ((s.largest + s.c) * pf_log1p(inside / s.c) - inside) / s.total;
}

// x for a uniform number xi
float LAW_radius(float xi, LAW_Shape s) {
    float share = clamp(xi, 0.0, 1.0);
    float ln = PF_SELECT(share < 0.1, pf_log1p(LAW_eps - share), log(LAW_eps + max(1.0 - share, 0.0)));
    return min(abs((s.k1 * share - s.k2) * sqrt(share) * ln), s.largest);
}

// Density in x of one branch of |g| below eps: the rising one (side 1) or the falling one (side -1). Newton's method
// for sqrt(1 - |g|/dip), which passes the turn in a straight line.
float LAW_branch_density(float x, float side, LAW_Shape s) {
    float v = sqrt(1.0 - min(x, s.dip) / s.dip);
    float u = PF_SELECT(side > 0.0, s.turn * (1.0 - v), s.turn + (1.0 - s.turn) * v);
    float low = PF_SELECT(side > 0.0, 0.0, s.turn);
    float high = PF_SELECT(side > 0.0, s.turn, 1.0);
    float least = 1e-6 * s.dip;
    for (int i = 0; i < LIANG_STEPS; ++i) {
        LAW_Local near = LAW_local(u, s);
        float h = sqrt(max(1.0 - near.radius / s.dip, 0.0));
        u = clamp(u + side * (h - v) * 2.0 * s.dip * h / max(side * near.slope, least), low, high);
    }
    LAW_Local here = LAW_local(u, s);
    return 2.0 * LAW_eps * u / max(side * here.slope, least);
}

// Density in x of LAW_radius beside its atom [1/mfp]: all three branches of |g| that reach x
float LAW_radius_density(float x, LAW_Shape s) {
    float target = clamp(x, PF_NEAREST, PF_FARTHEST);
    // Beyond eps |g| = (k2 - k1 xi) sqrt(xi) y rises with y = -ln(1 + eps - xi): Newton's method in ln y over ln x.
    float floor_k = 1e-3 * s.k2;
    float y = min(target / s.k2, LAW_depth);
    float growth = 1.0;
    float lever = s.k2;
    for (int i = 0; i < LIANG_STEPS; ++i) {
        float xi = LAW_eps + y * pf_mean_decay(y);
        lever = max(s.k2 - s.k1 * xi, floor_k);
        growth = max(1.0 + y * exp(-y) * (0.5 / xi - s.k1 / lever), 0.01);
        float step = clamp(log(target / (lever * sqrt(xi) * y)) / growth, -5.0, 5.0);
        y = clamp(y * exp(step), PF_NEAREST, LAW_depth);
    }
    float share = LAW_eps + y * pf_mean_decay(y);
    lever = max(s.k2 - s.k1 * share, floor_k);
    float left = exp(-y);
    growth = max(1.0 + y * left * (0.5 / share - s.k1 / lever), 0.01);
    float beyond = left / (lever * sqrt(share) * growth);
    float below = LAW_branch_density(x, 1.0, s) + LAW_branch_density(x, -1.0, s);
    float density = PF_SELECT(x < s.dip, below, 0.0) + PF_SELECT(x < (s.k2 - s.k1) * LAW_depth, beyond, 0.0);
    return PF_SELECT(x < s.largest, density, 0.0);
}
