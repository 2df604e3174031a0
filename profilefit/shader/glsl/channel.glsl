// A channel is 0, 1 or 2: red, green, blue.
float LAW_of(float channel, float red, float green, float blue) {
    return PF_SELECT(channel < 0.5, red, PF_SELECT(channel < 1.5, green, blue));
}
