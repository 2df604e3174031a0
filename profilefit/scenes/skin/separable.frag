// One of two passes, along rows or columns: Jimenez et al.'s filter, which follows the surface.

uniform sampler2D light_map, reflectance_map, position_map, kernel_map;
uniform vec2 direction; // of the pass
uniform vec2 size; // of the screen [pixels]
uniform float pixel; // its side [mm], in perspective at a depth of 1 mm
uniform float perspective;
uniform float follow; // share of a tap that is lost per depth between it and the pixel [1/mm]
uniform float last; // 1 where the reflectance multiplies

out vec4 exitance;

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 centre = texelFetch(position_map, here, 0);
    vec3 own = texelFetch(light_map, here, 0).rgb;
    float per_pixel = pixel * (perspective > 0.5 ? -centre.z : 1.0);
    bool inside = centre.w > 0.5;
    int taps = inside ? textureSize(kernel_map, 0).x : 0;
    vec3 light = inside ? vec3(0.0) : own;
    for (int i = 0; i < taps; ++i) {
        vec4 tap = texelFetch(kernel_map, ivec2(i, 0), 0);
        vec2 place = vec2(here) + 0.5 + direction * tap.w / per_pixel;
        vec3 taken = own;
        if (all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, size))) {
            vec4 hit = texelFetch(position_map, ivec2(place), 0);
            float lost = hit.w < 0.5 ? 1.0 : clamp(follow * abs(hit.z - centre.z), 0.0, 1.0);
            taken = mix(texelFetch(light_map, ivec2(place), 0).rgb, own, lost); // nearest: nothing dark seeps in
        }
        light += tap.rgb * taken;
    }
    vec3 reflectance = last > 0.5 ? texelFetch(reflectance_map, here, 0).rgb : vec3(1.0);
    exitance = vec4(reflectance * light, centre.w);
}
