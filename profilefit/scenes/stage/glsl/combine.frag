// Radiance towards the camera: light that scattered, light through thin parts, light that the surface mirrors.

uniform sampler2D exitance_map, irradiance_map, reflectance_map, position_map, normal_map;
uniform vec3 mfp; // [mm]
uniform vec3 fixed_alpha; // < 0: from A
uniform vec3 toward_light; // in view space
uniform vec3 light; // irradiance of a surface that faces it [-]
uniform float f0;
uniform float perspective;

out vec4 radiance;

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
float mirrored(vec3 normal, vec3 view, float roughness) {
    vec3 between = view + toward_light;
    vec3 middle = between / max(length(between), 1e-6); // no direction where the light is behind
    float nl = max(dot(normal, toward_light), 0.0), nv = max(dot(normal, view), 1e-3);
    float nh = max(dot(normal, middle), 0.0), vh = max(dot(view, middle), 0.0);
    float a = roughness * roughness, a2 = a * a;
    float spread = nh * nh * (a2 - 1.0) + 1.0;
    float heights = nl * sqrt(nv * nv * (1.0 - a2) + a2) + nv * sqrt(nl * nl * (1.0 - a2) + a2);
    float fresnel = f0 + (1.0 - f0) * pow(max(1.0 - vh, 0.0), 5.0);
    return a2 / (PI * spread * spread) * 0.5 / max(heights, 1e-6) * fresnel * nl;
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(position_map, here, 0);
    vec4 normal = texelFetch(normal_map, here, 0);
    vec4 reflectance = texelFetch(reflectance_map, here, 0);
    vec3 exitance = texelFetch(exitance_map, here, 0).rgb;
    float thickness = texelFetch(irradiance_map, here, 0).a;
    float behind = max(-dot(normal.xyz, toward_light), 0.0);
    if (position.w > 0.5 && behind > 0.0) exitance += through(reflectance.rgb, thickness) * behind * light;
    vec3 colour = exitance / PI;
    if (dot(normal.xyz, normal.xyz) > 0.0) {
        vec3 view = perspective > 0.5 ? normalize(-position.xyz) : vec3(0.0, 0.0, 1.0);
        colour += mirrored(normal.xyz, view, normal.w) * reflectance.a * light;
    }
    radiance = vec4(colour, position.w);
}
