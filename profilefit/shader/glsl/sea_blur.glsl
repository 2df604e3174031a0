// What water makes of a pencil of light at one depth: a part that is not scattered, and Gaussians of the rest.
float LAW_unscattered(float channel) {
    return LAW_of(channel, LAW_red_unscattered, LAW_green_unscattered, LAW_blue_unscattered);
}

//% for 1
float LAW_weight@i(float channel) {
    return LAW_of(channel, LAW_red_weight@i, LAW_green_weight@i, LAW_blue_weight@i);
}

float LAW_sigma@i(float channel) {
    return LAW_of(channel, LAW_red_sigma@i, LAW_green_sigma@i, LAW_blue_sigma@i);
}

//% end
// Share of the light within a radius r [m].
float LAW_share(float r, float channel) {
    float found = LAW_unscattered(channel);
    float x = 0.0;
    //% for 1
    x = r / LAW_sigma@i(channel);
    found = found + LAW_weight@i(channel) * LAW_faded(0.5 * x * x);
    //% end
    return found;
}

// Contrast that is left of a pattern of angular frequency k across the light [1/m], times its mean.
float LAW_mtf(float k, float channel) {
    float found = LAW_unscattered(channel);
    float x = 0.0;
    //% for 1
    x = k * LAW_sigma@i(channel);
    found = found + LAW_weight@i(channel) * exp(-0.5 * x * x);
    //% end
    return found;
}
