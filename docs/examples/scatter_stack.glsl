// Subsurface scattering in layers, by samples of a stack's profile model.
// Include the source of skin before it.
uniform sampler2D irradiance; // diffuse irradiance in red, green and blue [any unit]
uniform sampler2D thickness;  // of the first layer at each point [mm]
uniform vec2 texel;           // length of one texture coordinate [mm]

const int SAMPLES = 32;

vec3 radiance(vec2 uv) {
    vec3 found = vec3(0.0);
    for (int c = 0; c < 3; c++) {
        skin_Shape s = skin_shape(float(c), texture(thickness, uv).r); // once per point
        float light = 0.0;
        float weights = 0.0;
        for (int i = 0; i < SAMPLES; i++) {
            float x = skin_radius((float(i) + 0.5) / float(SAMPLES), s); // r / s.mfp
            float turn = 2.39996323 * float(i);                          // golden angle
            vec2 there = uv + s.mfp * x * vec2(cos(turn), sin(turn)) / texel;
            // weight: 2 pi x R_d / A over the density of the sampler, 1 on average
            float weight = skin_density(x, s) / skin_radius_density(x, s);
            light += weight * texture(irradiance, there)[c];
            weights += weight;
        }
        found[c] = skin_reflectance(s) * light / (3.14159265 * weights); // A / pi
    }
    return found;
}
