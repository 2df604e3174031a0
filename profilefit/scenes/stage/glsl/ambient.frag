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

const float SHOWN = 1.5, LEAST_SHOWN = 0.25; // pixels, over the cosine of normal and ray, that a point may lie off

// Share at the pixel that shows a point; 1 where none does.
float open(vec3 point, vec3 normal) {
    float depth = perspective > 0.5 ? -point.z : 1.0, side = pixel * depth;
    vec2 place = point.xy / side + 0.5 * size;
    if (!(depth > 0.0 && all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, size)))) return 1.0;
    vec3 there = texelFetch(seen_map, ivec2(place), 0).xyz;
    vec3 ray = perspective > 0.5 ? normalize(point) : vec3(0.0, 0.0, -1.0);
    float near = SHOWN * side / max(abs(dot(normal, ray)), LEAST_SHOWN);
    return length(there - point) < near ? texelFetch(occlusion_map, ivec2(place), 0).r : 1.0;
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
