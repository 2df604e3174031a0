// Two balls side by side as a screen wants them: Lambert's and the law's. Transparent around them.
uniform vec3 reflectance; // A [-]
uniform vec3 toward_light;
uniform float even;
uniform float side; // [pixels]
uniform highp usampler2D light_before, weight_before;
out vec4 colour;

vec3 srgb(vec3 linear) {
    vec3 clipped = clamp(linear, 0.0, 1.0);
    vec3 bright = 1.055 * pow(max(clipped, 1e-6), vec3(1.0 / 2.4)) - 0.055;
    return mix(bright, 12.92 * clipped, vec3(lessThanEqual(clipped, vec3(0.0031308))));
}

void main() {
    bool by_law = gl_FragCoord.x >= side;
    vec2 pixel = gl_FragCoord.xy - vec2(by_law ? side : 0.0, 0.0);
    vec3 light = vec3(irradiance(ball_normal(pixel, side), toward_light, even));
    if (by_law) {
        vec3 sum = uintBitsToFloat(texelFetch(light_before, ivec2(pixel), 0).rgb);
        vec3 weight = uintBitsToFloat(texelFetch(weight_before, ivec2(pixel), 0).rgb);
        light = sum / max(weight, 1e-20); // both are 0 in a black channel
    }
    float inside = 0.5 * (FILLED * side - length(2.0 * pixel - side));
    float cover = clamp(inside + 0.5, 0.0, 1.0);
    colour = vec4(srgb(reflectance * light) * cover, cover);
}
