// Light scattered once in a stack of layers of one index, exactly: with cosines mu_i and mu_o inside and
// b = 1 / mu_i + 1 / mu_o,
//     L = T_i T_o / n^2  cos_in / (mu_i mu_o)  sum_j alpha_j p_j e^{-b t_j} (1 - e^{-b d_j}) / b,
// t_j and d_j the optical depths above and inside layer j, infinite inside the last, p Henyey and Greenstein's phase
// function.

// Cosine inside
float LAW_inside(float outside) {
    return sqrt((LAW_index - 1.0) * (LAW_index + 1.0) + outside * outside) / LAW_index;
}

// Share that passes the surface at a cosine outside, cosine inside given [-]
float LAW_passed(float outside, float inside) {
    float across = outside + LAW_index * inside;
    float along = LAW_index * outside + inside;
    return 2.0 * LAW_index * outside * inside * (1.0 / (across * across) + 1.0 / (along * along));
}

// p [1/sr], of 1 less the cosine of the angle
float LAW_phase(float away, float g) {
    float apart = max((1.0 - g) * (1.0 - g) + 2.0 * g * away, PF_NEAREST);
    return (1.0 - g * g) / (2.0 * PF_TWO_PI * apart * sqrt(apart));
}

// Radiance outside [1/sr] for unit irradiance on a plane across the beam. Thickness of the first layer [length];
// cosines of beam and eye to the normal, outside; turned is the cosine of the angle between the two propagation
// directions along the surface, 1 onward.
float LAW_radiance(float channel, float thickness, float cos_in, float cos_out, float turned) {
    float within = clamp(cos_in, 1e-6, 1.0);
    float without = clamp(cos_out, 1e-6, 1.0);
    float mu_in = LAW_inside(within);
    float mu_out = LAW_inside(without);
    float b = 1.0 / mu_in + 1.0 / mu_out;
    float square_in = mu_in * mu_in;
    float square_out = mu_out * mu_out;
    float sines = sqrt((1.0 - within) * (1.0 + within) * (1.0 - without) * (1.0 + without)) / (LAW_index * LAW_index);
    // 1 - (sines turned - mu_in mu_out), without the cancellation of light that grazes the surface and goes on
    float grazing = (square_in + square_out - square_in * square_out) / (1.0 + sines);
    float away = grazing + mu_in * mu_out + sines * (1.0 - turned);
    float depth1 = max(thickness, 0.0) * LAW_of(channel, LAW_red_rate, LAW_green_rate, LAW_blue_rate);
//% for 3
    float depth@h = LAW_of(channel, LAW_red_depth@h, LAW_green_depth@h, LAW_blue_depth@h);
//% end
    float kept1 = 1.0;
    float sum = 0.0;
//% for 2
    float scattered@h = LAW_of(channel, LAW_red_scattered@h, LAW_green_scattered@h, LAW_blue_scattered@h);
    float phase@h = LAW_phase(away, LAW_of(channel, LAW_red_g@h, LAW_green_g@h, LAW_blue_g@h));
    sum = sum + kept@h * LAW_faded(b * depth@h) * scattered@h * phase@h;
    float kept@i = kept@h * exp(-b * depth@h);
//% end
    float scattered@n = LAW_of(channel, LAW_red_scattered@n, LAW_green_scattered@n, LAW_blue_scattered@n);
    float phase@n = LAW_phase(away, LAW_of(channel, LAW_red_g@n, LAW_green_g@n, LAW_blue_g@n));
    sum = sum + kept@n * scattered@n * phase@n; // of all that lies deeper
    float surface = LAW_passed(within, mu_in) * LAW_passed(without, mu_out) / (LAW_index * LAW_index);
    return surface * cos_in / (mu_in * mu_out * b) * sum;
}
