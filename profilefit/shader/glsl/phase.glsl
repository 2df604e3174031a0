// A sum of Henyey and Greenstein's phase functions. Arguments are off = 1 - cos(turn), which keeps its digits where light
// goes nearly straight on: of unit vectors 0.5 * dot(a - b, a - b), both along the light.
float LAW_term(float off, float g) {
    float square = (1.0 - g) * (1.0 - g) + 2.0 * g * off;
    return (1.0 - g * g) / (12.566370614359172 * square * sqrt(square));
}

float LAW_turn(float xi, float g) {
    float v = 2.0 * xi - 1.0;
    float reciprocal = 1.0 / (1.0 + g * v);
    return (1.0 - g) * (1.0 - g) * 0.5 * reciprocal * reciprocal * (1.0 - v) * (2.0 + g * (1.0 + v));
}

// Density of the direction [1/sr].
float LAW_pdf(float off) {
    float p = LAW_w1 * LAW_term(off, LAW_g1);
    //% for 2
    p += LAW_w@i * LAW_term(off, LAW_g@i);
    //% end
    return p;
}

// off for a uniform number xi in [0, 1).
float LAW_sample(float xi) {
    float left = LAW_w1;
    float off = LAW_turn(clamp(xi / LAW_w1, 0.0, 1.0), LAW_g1);
    //% for 2
    off = PF_SELECT(xi > left, LAW_turn(clamp((xi - left) / LAW_w@i, 0.0, 1.0), LAW_g@i), off);
    left += LAW_w@i;
    //% end
    return off;
}
