// Light that went in nearby comes out here: the self-normalised estimator of Liang et al., (22), for three channels,
//     L = A sum_i w_i E_i / sum_i w_i,   w_i / A = (r / D) density(D / l) / l / p(r) |dS / d screen|
// r is the radius drawn in the plane of the screen through the point, D the distance of the two points, both in mm.

uniform sampler2D irradiance_map, reflectance_map, position_map, normal_map, noise_map;
uniform vec3 mfp; // l [mm]
uniform vec3 fixed_alpha; // < 0: from A
uniform int samples;
uniform int longest; // channel
uniform int seed;
uniform int generator; // a of the lattice (i a / n, (i + 1/2) / n)
uniform vec4 cell; // its two edges: where the shifts are
uniform vec2 size; // of the screen [pixels]
uniform float pixel; // its side [mm], in perspective at a depth of 1 mm
uniform float perspective; // 1, or 0 for parallel rays

out vec4 exitance; // and the share of the law's energy that was found on the screen, least of the three [-]

const float TAU = 6.283185307179586;
const float NEAR = 1e-6; // least radius [mfp]: p and density are finite there
const float LEAST_COSINE = 0.05; // of normal and ray: at a silhouette one pixel would stand for any area
const vec2 LAMBERT = vec2(0.05, 0.1); // mfp [pixels] below which nothing is blurred, and from which all is
const float OWN = 1e-4; // weight of the pixel's own light, per sample: where nothing else is seen, Lambert
const float MOST_UNIFORM = 0.995; // share of the energy that uniform radii reach

// Permuted congruential generator in three dimensions (Jarzynski and Olano, JCGT 2020).
uvec3 pcg3d(uvec3 v) {
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z; v.y += v.z * v.x; v.z += v.x * v.y;
    return v;
}

// One shift of the whole lattice for each pixel, along both edges of its cell, in [0, 1).
vec2 shift(ivec2 place) {
#if BLUE
    // Each seed moves the tile and, by the golden ratio, its values: blue again.
    ivec2 side = textureSize(noise_map, 0);
    ivec2 moved = place + ivec2(pcg3d(uvec3(uint(seed), 17u, 4u)).xy & 1023u) * min(seed, 1);
    vec2 tile = texelFetch(noise_map, moved % side, 0).xy;
    return fract(tile + vec2(0.7548776662466927, 0.5698402909980532) * float(seed % 4096));
#else
    return vec2(pcg3d(uvec3(place, seed)).xy >> 8u) / 16777216.0;
#endif
}

// The ray through a place on the screen, to a depth of 1 mm.
vec3 ray(vec2 place) {
    return vec3(perspective * (place - 0.5 * size) * pixel, -1.0);
}

float world_per_pixel(float depth) {
    return pixel * (perspective > 0.5 ? depth : 1.0);
}

// Of this pixel: the law of each channel, and how far its uniform radii reach [mfp].
law_Shape shape[3];
float reach[3];

// x for a channel, and its density there, of the radii that this channel draws.
float drawn(float xi, int channel) {
#if UNIFORM
    return xi * reach[channel];
#else
    return law_radius(xi, shape[channel]);
#endif
}

float drawn_density(float x, int channel) {
#if UNIFORM
    return x <= reach[channel] ? 1.0 / reach[channel] : 0.0;
#else
    return law_radius_density(x, shape[channel]);
#endif
}

// Share of the samples that channel c draws: sample i is for channel (longest + i) mod 3.
float share_of(int c) {
    return float((samples - (c - longest + 3) % 3 + 2) / 3) / float(samples);
}

// p(r) [1/mm]
float radius_density(float r) {
#if MIXTURE
    float p = 0.0;
    for (int c = 0; c < 3; ++c) p += share_of(c) * drawn_density(r / mfp[c], c) / mfp[c];
    return p;
#else
    return drawn_density(r / mfp[longest], longest) / mfp[longest];
#endif
}

vec4 gathered(ivec2 here, float depth, vec3 own) {
    float per_pixel = world_per_pixel(depth);
    vec2 place_in_cell = shift(here);
    vec2 moved = place_in_cell.x * cell.xy + place_in_cell.y * cell.zw;
    vec3 light = OWN * float(samples) * own;
    vec3 weight = vec3(OWN * float(samples));
    for (int i = 0; i < samples; ++i) {
        int channel = MIXTURE == 1 ? (longest + i) % 3 : longest;
        float xi = fract(float((i * generator) % samples) / float(samples) + moved.x);
        float angle = TAU * fract((float(i) + 0.5) / float(samples) + moved.y);
        float r = max(drawn(xi, channel), NEAR) * mfp[channel];
        vec2 side = r * vec2(cos(angle), sin(angle));
        vec2 place = vec2(here) + 0.5 + side / per_pixel;
        // Compared as floats: a radius far away does not fit an integer.
        if (!(all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, size)))) continue; // so that NaN is out, too
        ivec2 there = ivec2(place);
        vec4 hit = texelFetch(position_map, there, 0);
        if (hit.w < 0.5) continue;
        float hit_depth = -hit.z;
        vec3 along = ray(place);
        float area = 1.0;
#if AREA
        vec3 normal = texelFetch(normal_map, there, 0).xyz;
        float facing = max(abs(dot(normal, along)), LEAST_COSINE);
        // From the pixel's middle to where the ray meets its plane.
        vec2 off = (place - vec2(there) - 0.5) * world_per_pixel(hit_depth);
        hit_depth += dot(normal.xy, off) / (dot(normal, along) < 0.0 ? facing : -facing);
        float nearer = perspective > 0.5 ? hit_depth / depth : 1.0;
        area = nearer * nearer / facing;
#endif
        float distance = length(vec3(side, 0.0) + along * (hit_depth - depth));
        float p = radius_density(r);
        if (!(p > 0.0)) continue;
        float common_part = area * r / (max(distance, NEAR * mfp[longest]) * p);
        vec3 w;
        for (int c = 0; c < 3; ++c) w[c] = common_part * law_density(distance / mfp[c], shape[c]) / mfp[c];
        light += w * texelFetch(irradiance_map, there, 0).rgb;
        weight += w;
    }
    vec3 found = weight / float(samples) - OWN;
    return vec4(light / weight, min(found.x, min(found.y, found.z)));
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec4 centre = texelFetch(position_map, here, 0);
    vec3 own = texelFetch(irradiance_map, here, 0).rgb;
    vec3 surface = texelFetch(reflectance_map, here, 0).rgb;
    vec3 colour = surface;
    vec4 light = vec4(own, 1.0);
    // So short a mean free path does not leave the pixel: Lambert, to a part in 1000.
    vec3 across = mfp / world_per_pixel(-centre.z);
    vec3 blurred = clamp((across - LAMBERT.x) / (LAMBERT.y - LAMBERT.x), 0.0, 1.0);
    if (centre.w > 0.5) {
        for (int c = 0; c < 3; ++c) {
            shape[c] = SHAPE(surface, c);
            colour[c] = COLOUR(surface, c, shape[c]); // where nothing is blurred, too
#if UNIFORM
            reach[c] = law_radius(MOST_UNIFORM, shape[c]);
#endif
        }
        if (any(greaterThan(blurred, vec3(0.0)))) {
            vec4 found = gathered(here, -centre.z, own);
            light = vec4(mix(own, found.rgb, blurred), found.w);
        }
    }
    exitance = vec4(colour * light.rgb, light.w);
}
