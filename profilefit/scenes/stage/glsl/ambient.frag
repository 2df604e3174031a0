// Irradiance from all directions: the same all over the sky, and the environment's by harmonics, less what is occluded.

uniform sampler2D position_map, normal_map;
uniform sampler2D seen_map, occlusion_map; // of the screen: its positions in view space, and shares that arrive
uniform mat4 to_world; // from the maps' space
uniform mat4 to_view; // from the maps' space to that of the screen
uniform vec3 ambient; // [-]
uniform float occluded; // 1, or 0 for light that nothing occludes
uniform vec2 size; // of the screen [pixels]
uniform float pixel; // its side [mm], in perspective at a depth of 1 mm
uniform float perspective;

out vec4 irradiance;

const int ACROSS = 1; // neighbours to each side, over which the noise of the search is a mean
const float LEVEL = 1.0; // pixels off the plane, within which they are of the same surface
const float SHOWN = 1.5, LEAST_SHOWN = 0.25; // pixels, over the cosine of normal and ray, that a point may lie off

// Share at the pixel that shows a point, and a mean over its neighbours in the same plane; 1 where none shows it.
float open(vec3 point, vec3 normal) {
    float depth = perspective > 0.5 ? -point.z : 1.0, side = pixel * depth;
    vec2 place = point.xy / side + 0.5 * size;
    if (!(depth > 0.0 && all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, size)))) return 1.0;
    vec3 ray = perspective > 0.5 ? normalize(point) : vec3(0.0, 0.0, -1.0);
    float near = SHOWN * side / max(abs(dot(normal, ray)), LEAST_SHOWN);
    if (!(length(texelFetch(seen_map, ivec2(place), 0).xyz - point) < near)) return 1.0;
    float total = 0.0, weight = 0.0;
    for (int y = -ACROSS; y <= ACROSS; ++y) {
        for (int x = -ACROSS; x <= ACROSS; ++x) {
            ivec2 there = clamp(ivec2(place) + ivec2(x, y), ivec2(0), ivec2(size) - 1);
            vec3 apart = texelFetch(seen_map, there, 0).xyz - point;
            if (abs(dot(apart, normal)) > LEVEL * side) continue;
            total += texelFetch(occlusion_map, there, 0).r;
            weight += 1.0;
        }
    }
    return weight > 0.0 ? total / weight : texelFetch(occlusion_map, ivec2(place), 0).r;
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 normal = texelFetch(normal_map, here, 0).xyz;
    irradiance = vec4(0.0);
    if (dot(normal, normal) == 0.0) return;
    vec3 point = (to_view * vec4(texelFetch(position_map, here, 0).xyz, 1.0)).xyz;
    float share = occluded > 0.5 ? open(point, mat3(to_view) * normal) : 1.0;
    irradiance.rgb = share * (ambient + by_harmonics(mat3(to_world) * normal));
}
