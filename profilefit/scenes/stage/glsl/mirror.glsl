// Of one lamp: light that comes through thin parts, and light that the surface mirrors.
uniform vec3 mfp; // [mm]
uniform vec3 fixed_alpha; // < 0: from A
uniform vec3 light; // irradiance of a surface that faces it [-]
uniform float f0;

const float PI = 3.141592653589793;

// Energy that has not come out within the thickness comes out behind it; A of the side that is seen.
vec3 through(vec3 surface, float thickness) {
    vec3 colour, rest;
    for (int c = 0; c < 3; ++c) {
        law_Shape shape = SHAPE(surface, c);
        colour[c] = COLOUR(surface, c, shape);
        rest[c] = max(1.0 - law_cumulated(thickness / mfp[c], shape), 0.0);
    }
    return colour * rest;
}

// Torrance and Sparrow with GGX, Smith's heights correlated, Fresnel by Schlick: times cosine [1/sr].
float mirrored(vec3 normal, vec3 view, vec3 toward, float roughness) {
    vec3 between = view + toward;
    vec3 middle = between / max(length(between), 1e-6); // no direction where the light is behind
    float nl = max(dot(normal, toward), 0.0), nv = max(dot(normal, view), 1e-3);
    float nh = max(dot(normal, middle), 0.0), vh = max(dot(view, middle), 0.0);
    float a = roughness * roughness, a2 = a * a;
    float spread = nh * nh * (a2 - 1.0) + 1.0;
    float heights = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
    float fresnel = f0 + (1.0 - f0) * pow(max(1.0 - vh, 0.0), 5.0);
    return a2 / (PI * spread * spread) * 0.5 / max(heights, 1e-6) * fresnel * nl;
}
