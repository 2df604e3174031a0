// Subsurface scattering of one colour channel, by samples of a profile model.
// Include the source of hazard-diffuse before it.
uniform sampler2D irradiance; // diffuse irradiance at each point [any unit]
uniform vec2 texel;           // length of one texture coordinate [unit of mfp]
uniform float colour, mfp;    // total diffuse reflectance A; transport mean free path

const int SAMPLES = 32;

float radiance(vec2 uv) {
    hazard_Shape s = hazard_shape(hazard_alpha(colour)); // once per material
    float sum = 0.0;
    for (int i = 0; i < SAMPLES; i++) {
        float x = hazard_radius((float(i) + 0.5) / float(SAMPLES), s); // r / mfp
        float turn = 2.39996323 * float(i);                            // golden angle
        vec2 there = uv + mfp * x * vec2(cos(turn), sin(turn)) / texel;
        // weight: 2 pi x R_d / A over the density of the sampler, nearly 1
        float weight = hazard_density(x, s) / hazard_radius_density(x, s);
        sum += weight * texture(irradiance, there).r;
    }
    return hazard_reflectance(s) * sum / (3.14159265 * float(SAMPLES));
}
