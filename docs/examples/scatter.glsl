// Light scattered under a surface, one colour channel, by samples of the law. Include the text of hazard-diffuse before it.
uniform sampler2D irradiance; // cosine-weighted light that arrives at each point [any unit]
uniform vec2 texel;           // the length of one texture coordinate, in the unit of mfp
uniform float colour, mfp;    // total reflectance A [-]; mean free path [length]

const int SAMPLES = 32;

float radiance(vec2 uv) {
    hazard_Shape s = hazard_shape(hazard_alpha(colour)); // once a material; once a pixel where A is a texture
    float sum = 0.0;
    for (int i = 0; i < SAMPLES; i++) {
        float x = hazard_radius((float(i) + 0.5) / float(SAMPLES), s); // r / mfp
        float turn = 2.39996323 * float(i);                            // the golden angle spreads them around
        vec2 there = uv + mfp * x * vec2(cos(turn), sin(turn)) / texel;
        // 2 pi x R_d over the density of this very map: 1 but for the sampler's own error
        sum += texture(irradiance, there).r * hazard_density(x, s) / hazard_radius_density(x, s);
    }
    return hazard_reflectance(s) * sum / (3.14159265 * float(SAMPLES));
}
