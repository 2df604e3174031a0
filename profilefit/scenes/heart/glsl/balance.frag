// Light of both parts of a kernel, times its reflectance: what is near from the screen; what is far from the screen too
// where it sees nearly all of it, else from the atlas.

uniform sampler2D near_map, far_map, atlas_map, place_map, position_map, irradiance_map, reflectance_map;
uniform vec3 near_energy, far_energy; // [-], their sum is the kernel's
uniform vec2 inset; // share of the atlas that u and v from 0 to 1 take
uniform float threshold; // of the share that the screen sees

out vec4 exitance;

// Bilinear between texels that are surface.
vec4 atlas_at(vec2 uv) {
    ivec2 size = textureSize(atlas_map, 0);
    vec2 place = (0.5 + (uv - 0.5) * inset) * vec2(size) - 0.5;
    vec2 corner = floor(place), rest = place - corner;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 4; ++i) {
        ivec2 step = ivec2(i & 1, i >> 1);
        vec2 near = mix(1.0 - rest, rest, vec2(step));
        vec4 there = texelFetch(atlas_map, clamp(ivec2(corner) + step, ivec2(0), size - 1), 0);
        sum += near.x * near.y * there.w * vec4(there.rgb, 1.0);
    }
    return sum.w > 0.0 ? sum / sum.w : vec4(0.0);
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 surface = texelFetch(reflectance_map, here, 0).rgb;
    float inside = texelFetch(position_map, here, 0).w;
    if (inside < 0.5) {
        exitance = vec4(surface * texelFetch(irradiance_map, here, 0).rgb, 0.0);
        return;
    }
    vec4 near = texelFetch(near_map, here, 0), far = texelFetch(far_map, here, 0);
    vec3 distant = far_energy * far.rgb;
    if (!(far.w > threshold)) distant = atlas_at(texelFetch(place_map, here, 0).xy).rgb;
    exitance = vec4(surface * (near_energy * near.rgb + distant), far.w);
}
