// Light scattered once leaves as it does, not in all directions alike: its exact radiance in place of its share of a
// white wall's, so that no energy comes or goes. Of lamps only; the sky's light has no direction.

uniform sampler2D once_table; // exitance over irradiance; cosine of the light along rows, 0 to 1, thickness across
uniform vec3 light; // irradiance of a surface that faces it [-]

const float PI = 3.141592653589793;

// Between four values of the table, even in both.
vec3 left_once(float cosine, float share) {
    ivec2 last = textureSize(once_table, 0) - 1;
    vec2 place = clamp(vec2(cosine, share) * vec2(last), vec2(0.0), vec2(last));
    ivec2 corner = min(ivec2(place), max(last - 1, ivec2(0)));
    vec2 rest = place - vec2(corner);
    ivec2 next = min(corner + 1, last);
    vec3 low = mix(texelFetch(once_table, corner, 0).rgb, texelFetch(once_table, ivec2(next.x, corner.y), 0).rgb, rest.x);
    vec3 high = mix(texelFetch(once_table, ivec2(corner.x, next.y), 0).rgb, texelFetch(once_table, next, 0).rgb, rest.x);
    return mix(low, high, rest.y);
}

// What comes in addition to exitance, of light that nothing shades: directions of surface, eye and lamp.
vec3 added(vec3 normal, vec3 view, vec3 toward, vec3 surface) {
    float cos_in = dot(normal, toward), cos_out = dot(normal, view);
    if (cos_in <= 0.0 || cos_out <= 0.0) return vec3(0.0);
    // Along the surface light goes on against its direction from the lamp, and to the eye.
    vec3 onward = cos_in * normal - toward, leaving = view - cos_out * normal;
    float lengths = length(onward) * length(leaving);
    float turned = lengths > 1e-6 ? clamp(dot(onward, leaving) / lengths, -1.0, 1.0) : 1.0;
    vec3 alike = cos_in * left_once(cos_in, surface.r), found;
    for (int c = 0; c < 3; ++c) {
        float radiance = once_radiance(float(c), THICKNESS(surface), cos_in, cos_out, turned);
        found[c] = light[c] * (PI * radiance - alike[c]);
    }
    return found;
}
