// A sum of cosines over a tile: (whole waves along x and y, amplitude, phase in turns), one a texel of the first row.
const float TURN = 6.283185307179586;

// z above its mean level, dz/dx and dz/dy at a place; the tile in the unit of both.
vec3 waves_at(sampler2D waves, float tile, vec2 place) {
    vec3 sum = vec3(0.0);
    vec2 share = place / tile;
    for (int i = 0; i < textureSize(waves, 0).x; ++i) {
        vec4 one = texelFetch(waves, ivec2(i, 0), 0);
        float angle = TURN * fract(dot(one.xy, share) + one.w);  // small angles keep their digits in float32
        sum += one.z * vec3(cos(angle), -sin(angle) * TURN / tile * one.xy);
    }
    return sum;
}
