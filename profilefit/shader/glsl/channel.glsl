// A channel is 0, 1 or 2: red, green, blue.
float LAW_of(float channel, float red, float green, float blue) {
    return PF_SELECT(channel < 0.5, red, PF_SELECT(channel < 1.5, green, blue));
}

// 1 - e^-t, without the cancellation where t is small
float LAW_faded(float t) {
    float s = min(t, 0.05);
    float thin = s * (1.0 - s / 2.0 * (1.0 - s / 3.0 * (1.0 - s / 4.0 * (1.0 - s / 5.0 * (1.0 - s / 6.0)))));
    return PF_SELECT(t < 0.05, thin, 1.0 - exp(-t));
}
