#define INVERSE_HALVINGS 12
#define INVERSE_STEPS 3
#define ALBEDO_HALVINGS 32

// x for a uniform number xi: halvings of a bracket of ln x, then Newton's method inside it. No closed inverse is known.
float LAW_radius(float xi, LAW_Shape s) {
    float share = clamp(xi, 0.0, PF_MOST_XI);
    float low = -25.0;
    float high = 18.4; // x < PF_FARTHEST
    for (int i = 0; i < INVERSE_HALVINGS; ++i) {
        float middle = 0.5 * (low + high);
        bool below = LAW_cumulated(exp(middle), s) < share;
        low = PF_SELECT(below, middle, low);
        high = PF_SELECT(below, high, middle);
    }
    float y = 0.5 * (low + high);
    for (int j = 0; j < INVERSE_STEPS; ++j) {
        float x = exp(y);
        float excess = LAW_cumulated(x, s) - share;
        y = clamp(y - excess / max(x * LAW_density(x, s), 1e-30), low, high);
    }
    return exp(y);
}

// Density in x of LAW_radius [1/mfp]
float LAW_radius_density(float x, LAW_Shape s) {
    return LAW_density(x, s);
}

// The alpha [-] at which this law itself reflects A, as those who render with it invert it (Jensen and Buhler 2002,
// Hery 2012): a texture of A stays what it is. The half space of that alpha reflects otherwise.
float LAW_alpha(float reflectance) {
    float share = clamp(reflectance, 0.0, LAW_MAX_REFLECTANCE);
    float low = 0.0; // of s = sqrt(1 - alpha)
    float high = 1.0;
    for (int i = 0; i < ALBEDO_HALVINGS; ++i) {
        float middle = 0.5 * (low + high);
        bool brighter = LAW_reflectance(LAW_shape((1.0 - middle) * (1.0 + middle))) > share;
        low = PF_SELECT(brighter, middle, low);
        high = PF_SELECT(brighter, high, middle);
    }
    float dark = 0.5 * (low + high);
    return (1.0 - dark) * (1.0 + dark);
}
