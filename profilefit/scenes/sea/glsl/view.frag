// Radiance that a pixel sees under the waves: floor, surface from below, and what the water between scatters.
in vec2 where;
out vec4 radiance;
uniform sampler2D sea_map;  // z, dz/dx and dz/dy over the tile
uniform sampler2D floor_waves;
uniform sampler2D fade_map;  // optical lengths over lengths to `reach`: rows of what is sharp, of shafts, of wide light
uniform sampler2D turn_map;  // ln of the phase function, blurred by the spread of the sun's rays, over (angle / pi)^(1/4)
uniform sampler2D glow_map;  // -ln of what of sky's and floor's light turns into a view, over its cosine and the depth
uniform float glow_depth;  // to which that goes [m]
uniform sampler2D blur_map;  // Gaussians of the floor's light: rows of their weights, and of their levels of detail
uniform sampler2D floor_map;  // caustics on the floor, 1 the mean
uniform sampler2D shaft_map;  // a column of square maps at depths from first_depth on, depth_step apart
uniform float tile;
uniform vec3 bed;  // mean, lowest and highest level of the floor [m]
uniform float crest;  // no wave is higher [m]
uniform int steps;  // of the search for a hit
uniform vec3 eye;
uniform vec3 forward;
uniform vec3 right;  // half the picture's sides at a distance of 1
uniform vec3 up;
uniform float angle;  // that a pixel is wide [rad]
uniform float reach;  // farthest that is seen [m]
uniform float n;
uniform vec3 beam;  // the calm sea's ray
uniform float floor_drift;  // of the floor's map [m]
uniform float shaft;  // half-width of one [m]
uniform float first_depth;
uniform float depth_step;
uniform vec3 b;
uniform vec3 sunlight;  // that came in, per horizontal area
uniform vec3 skylight;
uniform vec3 sky;  // irradiance above
uniform vec3 reflectance;
uniform vec3 sky_on_floor;  // share of its light
uniform vec3 again;  // irradiance of the floor by its own light, which the surface mirrors
uniform float turn;  // 1 - cosine of turns, a share of 1 / e of which are of unscattered light
uniform float rate;  // of pieces with equal shares of the light [1/m]
uniform int pieces;
uniform int looks;  // at the shafts, of a piece
uniform int views;  // of a pixel along a side, which look at different places of a piece
const float PI = 3.141592653589793;
const float SPREAD = 0.06;  // angle by which light spreads on its way to the eye, whose picture of the floor it blurs [rad]

bool is_upside_down = false;  // the waves from below are a floor upside down

// The waves, bilinear between the texels' middles; the tile repeats.
vec3 sea_at(vec2 place) {
    int side = textureSize(sea_map, 0).x;
    vec2 texel = place / tile * float(side) - 0.5, corner = floor(texel), share = texel - corner;
    ivec2 low = ivec2(mod(corner, float(side))), high = (low + 1) % side;
    vec3 bottom = mix(texelFetch(sea_map, low, 0).xyz, texelFetch(sea_map, ivec2(high.x, low.y), 0).xyz, share.x);
    vec3 top = mix(texelFetch(sea_map, ivec2(low.x, high.y), 0).xyz, texelFetch(sea_map, high, 0).xyz, share.x);
    return mix(bottom, top, share.y);
}

vec3 floor_at(vec2 place) {
    if (is_upside_down) return -sea_at(place);
    vec3 ground = waves_at(floor_waves, tile, place);
    return vec3(bed.x + ground.x, ground.yz);
}

// A row of a table over x in [0, 1], linear between the middles of its texels' first and last.
vec3 row_of(sampler2D table, int row, float x) {
    int last = textureSize(table, 0).x - 1;
    float at = clamp(x, 0.0, 1.0) * float(last);
    int first = min(int(at), last - 1);
    return mix(texelFetch(table, ivec2(first, row), 0).xyz, texelFetch(table, ivec2(first + 1, row), 0).xyz, at - float(first));
}

vec3 glowing(float cosine, float depth) {
    int rows = textureSize(glow_map, 0).y;
    float at = clamp(depth / glow_depth, 0.0, 1.0) * float(rows - 1), x = 0.5 * cosine + 0.5;
    int first = min(int(at), rows - 2);
    return mix(row_of(glow_map, first, x), row_of(glow_map, first + 1, x), at - float(first));
}

vec3 fading(int row, float way) {
    return row_of(fade_map, row, way / reach);
}

// Phase function between two unit vectors.
float phase_of(vec3 from, vec3 to) {
    float angle = 2.0 * asin(min(0.5 * distance(from, to), 1.0));
    return exp(row_of(turn_map, 0, sqrt(sqrt(angle / PI))).x);
}

// One map of the column, bilinear; the tile repeats. The map has drifted by whole texels, which `drift` are not.
float of_map(int number, vec2 texel) {
    int side = textureSize(shaft_map, 0).x;
    vec2 corner = floor(texel - 0.5), share = texel - 0.5 - corner;
    ivec2 low = ivec2(mod(corner, float(side))), high = (low + 1) % side;
    low.y += number * side;
    high.y += number * side;
    float bottom = mix(texelFetch(shaft_map, low, 0).x, texelFetch(shaft_map, ivec2(high.x, low.y), 0).x, share.x);
    float top = mix(texelFetch(shaft_map, ivec2(low.x, high.y), 0).x, texelFetch(shaft_map, high, 0).x, share.x);
    return mix(bottom, top, share.y);
}

// The sun's light by its mean at a place in the water: the two maps around its depth, each seen along the calm ray.
float shaft_at(vec3 place) {
    int side = textureSize(shaft_map, 0).x, count = textureSize(shaft_map, 0).y / side;
    float pixel = tile / float(side), calm = beam.x / -beam.z;
    float entered = place.x + calm * place.z;
    float level = (-place.z - first_depth) / depth_step;
    int first = clamp(int(floor(level)), -1, count - 2);
    float light[2];
    for (int i = 0; i < 2; ++i) {
        float drift = calm * (first_depth + float(first + i) * depth_step) / pixel;
        vec2 texel = vec2(entered, place.y) / pixel + vec2(drift - round(drift), 0.0);
        light[i] = first + i < 0 ? 1.0 : of_map(first + i, texel);
    }
    float share = first < 0 ? -place.z / first_depth : level - float(first);
    return mix(light[0], light[1], clamp(share, 0.0, 1.0));
}

// int e^-way over a piece, `way` linear between its ends.
vec3 between(vec3 begin, vec3 end, float length) {
    return vec3(
        segment_between(begin.x, end.x, length), segment_between(begin.y, end.y, length), segment_between(begin.z, end.z, length)
    );
}

// What the water of a straight way scatters to the eye, which has come `gone` before it begins.
vec3 haze(vec3 from, vec3 along, float gone, float way) {
    vec3 sum = vec3(0.0);
    float turned = phase_of(along, -beam), slant = -1.0 / beam.z;
    vec3 sunny = b * sunlight * slant * turned;
    float fresh = exp(-(1.0 + dot(along, beam)) / turn);  // share of this turn's light that was not scattered before
    // A look that crosses shafts sees their mean: sinc to its second order, of light whose waves are four half-widths.
    float crossed = length(along - beam * along.z / beam.z) / shaft;
    float k = rate, whole = 1.0 - exp(-k * way), t = 0.0;
    ivec2 view = ivec2(gl_FragCoord.xy) % views;
    float each = 1.0 / float(views * views), place = (float(view.x + views * view.y) + 0.5) * each;
    vec3 narrow = fading(1, gone) + fading(1, -from.z * slant), wide = fading(2, gone) + fading(2, -from.z * slant);
    vec3 sharp = fading(2, gone) + fading(0, -from.z * slant);
    vec3 glow = fading(2, gone) + glowing(along.z, -from.z);
    for (int i = 1; i <= pieces; ++i) {
        float next = i == pieces ? way : -log(1.0 - whole * float(i) / float(pieces)) / k;
        float depth = -min(from.z + next * along.z, 0.0), step = next - t;
        vec3 back = fading(2, gone + next);
        vec3 narrow_end = fading(1, gone + next) + fading(1, depth * slant);
        vec3 wide_end = back + fading(2, depth * slant), glow_end = back + glowing(along.z, depth);
        vec3 sharp_end = back + fading(0, depth * slant);
        float light = 0.0, look = step * each / float(looks);
        for (int j = 0; j < looks; ++j) light += shaft_at(from + mix(t, next, (place + float(j)) / float(looks)) * along) - 1.0;
        light *= exp(-0.1028 * look * look * crossed * crossed) / float(looks);
        vec3 mean = mix(between(wide, wide_end, step), between(sharp, sharp_end, step), fresh);
        sum += sunny * (light * between(narrow, narrow_end, step) + mean);
        sum += b * between(glow, glow_end, step);
        narrow = narrow_end;
        wide = wide_end;
        sharp = sharp_end;
        glow = glow_end;
        t = next;
    }
    return sum;
}

// Radiance of the floor at a place, to the eye after a way.
vec3 ground(vec3 place, float way, float slope) {
    vec3 surface = floor_at(place.xy);
    float facing = inversesqrt(1.0 + dot(surface.yz, surface.yz)), down = -place.z / -beam.z;
    vec2 at = (place.xy - vec2(floor_drift, 0.0)) / tile;
    float texels = float(textureSize(floor_map, 0).x), foot = log2(max(way * angle / sqrt(max(slope, 0.05)) / tile * texels, 1.0));
    vec3 lit = exp(-fading(0, down)) * textureLod(floor_map, at, foot).x;
    for (int i = 0; i < textureSize(blur_map, 0).x; ++i) {
        vec3 weight = texelFetch(blur_map, ivec2(i, 0), 0).xyz, level = texelFetch(blur_map, ivec2(i, 1), 0).xyz;
        for (int one = 0; one < 3; ++one) lit[one] += weight[one] * textureLod(floor_map, at, max(level[one], foot)).x;
    }
    lit = (lit * sunlight + sky_on_floor * skylight + again) * facing;
    // Of what small turns bring, `haze` has the floor's mean: what is brighter around the place adds its own.
    vec3 sharp = exp(-fading(0, way)), near = exp(-fading(2, way)) - sharp;
    float around = textureLod(floor_map, at, log2(max(2.0 * SPREAD * way / tile * texels, 1.0))).x - 1.0;
    return (sharp * lit + near * around * exp(-fading(0, down)) * sunlight * facing) * reflectance / PI;
}

// Floor and water along a way that goes down, after the eye's way to its begin.
vec3 downward(vec3 from, vec3 along, float gone) {
    float far = first_hit(from, along, bed.y, bed.z, steps), length = max(reach - gone, 0.0);
    bool hits = far >= 0.0 && far < length;
    vec3 sum = haze(from, along, gone, hits ? far : length);
    if (hits) sum += ground(from + far * along, gone + far, -along.z);
    return sum;
}

void main() {
    vec3 along = normalize(forward + where.x * right + where.y * up), sum;
    if (along.z <= 0.0) {
        sum = downward(eye, along, 0.0);
    } else {
        const vec3 flip = vec3(1.0, 1.0, -1.0);
        is_upside_down = true;
        float far = first_hit(flip * eye, flip * along, -crest, crest, steps);
        is_upside_down = false;
        if (far < 0.0) far = 2.0 * reach;
        sum = haze(eye, along, 0.0, min(far, reach));
        if (far < reach) {
            vec3 waves = sea_at((eye + far * along).xy);
            vec3 normal = normalize(vec3(-waves.yz, 1.0));
            float inside = clamp(dot(along, normal), 0.0, 1.0), outside = sqrt(max(1.0 - n * n * (1.0 - inside * inside), 0.0));
            float across = (n * inside - outside) / (n * inside + outside), flat_one = (inside - n * outside) / (inside + n * outside);
            float mirrored = outside > 0.0 ? 0.5 * (across * across + flat_one * flat_one) : 1.0;
            sum += exp(-fading(0, far)) * (1.0 - mirrored) * n * n * sky / PI;
            vec3 back = along - 2.0 * dot(along, normal) * normal;
            back.z = -abs(back.z);
            vec3 from = eye + far * along;
            if (mirrored > 0.01) sum += mirrored * downward(vec3(from.xy, min(from.z, -1e-4)), normalize(back), far);
        }
    }
    radiance = vec4(sum, 1.0);
}
