// Share of a lamp's light that arrives at a point of the world, and how far it came through the part.
uniform mat4 light_clip;
uniform vec3 toward_light; // in the world
uniform sampler2D shadow_map; // depth along the light [mm]
uniform float shadow_pixel; // side of a texel [mm]

const float EMPTY = 1e5; // depth where nothing is [mm]
// In texels: out of the surface against shadows of itself, as far as the filter's slope asks; into it for the thickness.
const float OUTWARD = 2.5;
const float INWARD = 2.0;

float depth_at(ivec2 texel) {
    return texelFetch(shadow_map, clamp(texel, ivec2(0), textureSize(shadow_map, 0) - 1), 0).r;
}

vec2 texel_of(vec3 point) {
    return (0.5 + 0.5 * (light_clip * vec4(point, 1.0)).xy) * vec2(textureSize(shadow_map, 0)) - 0.5;
}

// Share of the light that arrives: a tent of two texels' half width over comparisons.
float visibility(vec3 surface, vec3 normal) {
    vec3 point = surface + OUTWARD * shadow_pixel * normal;
    vec2 place = texel_of(point);
    ivec2 corner = ivec2(floor(place));
    vec2 rest = place - vec2(corner);
    float depth = -dot(point, toward_light) - 0.5 * shadow_pixel;
    float seen = 0.0;
    for (int y = -1; y <= 2; ++y) {
        for (int x = -1; x <= 2; ++x) {
            vec2 tent = 2.0 - abs(vec2(x, y) - rest);
            seen += tent.x * tent.y * step(depth, depth_at(corner + ivec2(x, y)));
        }
    }
    return seen / 16.0;
}

// From where the light went in to here [mm]: linear between four texels, those that the light misses left out.
float thickness(vec3 surface, vec3 normal) {
    vec3 point = surface - INWARD * shadow_pixel * normal;
    vec2 place = texel_of(point);
    ivec2 corner = ivec2(floor(place));
    vec2 rest = place - vec2(corner);
    float depth = -dot(point, toward_light), total = 0.0, weight = 0.0;
    for (int y = 0; y <= 1; ++y) {
        for (int x = 0; x <= 1; ++x) {
            float there = depth_at(corner + ivec2(x, y));
            vec2 near = 1.0 - abs(vec2(x, y) - rest);
            float w = there < EMPTY ? near.x * near.y + 1e-6 : 0.0;
            total += w * max(depth - there, 0.0);
            weight += w;
        }
    }
    return weight > 0.0 ? total / weight : EMPTY;
}
