// Share of an even sky's irradiance that arrives, as far as the screen shows what is in the way.
// In slices through the line of sight, the cosine is integrated over what no pixel hides. A pixel stands for a plate
// between the depth where its ray goes in and where it comes out, as wide as the step of the search. Sectors of a slice
// that plates hide are bits (after Therrien et al. 2023), each of as much of the cosine's integral (Jimenez et al. 2016).

uniform sampler2D position_map, normal_map;
uniform sampler2D back_map; // depth where a ray comes out, 0 where it does not [mm]
uniform vec2 size; // of the screen [pixels]
uniform float pixel; // its side [mm], in perspective at a depth of 1 mm
uniform float perspective;
uniform float reach; // of the search [mm]
uniform int slices, steps;

out float share;

const float PI = 3.141592653589793;
const float SECTORS = 32.0;
const float NEAREST = 1.0; // first step [pixels]
const float STEEPEST = 12.0; // of a plate, depth over width
const float FACETS = 0.03; // sine above the tangent plane, below which what is in the way is the mesh's own facets
const float GOLDEN = 0.618034; // by which the steps of one side and slice are shifted against those of the next
const float ENDLESS = 1e4; // thickness of what rays do not come out of [mm]

// Interleaved gradient noise in [0, 1): all of its values in each square of a few pixels.
float noise(vec2 place, float number) {
    return fract(52.9829189 * fract(dot(place + 5.588238 * number, vec2(0.06711056, 0.00583715))));
}

// Integral of the cosine to the normal, which is turned from the line of sight, between that and an angle.
float arc(float angle, float turned) {
    return 0.25 * (cos(turned) - cos(2.0 * angle - turned) + 2.0 * angle * sin(turned));
}

uint bits_between(float low, float high) {
    uint first = uint(clamp(low, 0.0, SECTORS)), last = uint(clamp(high, 0.0, SECTORS));
    if (last <= first) return 0u;
    uint count = last - first;
    return (count >= 32u ? 0xffffffffu : (1u << count) - 1u) << first;
}

float counted(uint bits) {
    bits -= (bits >> 1u) & 0x55555555u;
    bits = (bits & 0x33333333u) + ((bits >> 2u) & 0x33333333u);
    return float((((bits + (bits >> 4u)) & 0x0f0f0f0fu) * 0x01010101u) >> 24u);
}

// The point that a place on the screen shows at a depth.
vec3 at_depth(vec2 place, float depth) {
    return vec3((place - 0.5 * size) * pixel * (perspective > 0.5 ? depth : 1.0), -depth);
}

void main() {
    ivec2 here = ivec2(gl_FragCoord.xy);
    vec3 point = texelFetch(position_map, here, 0).xyz, normal = texelFetch(normal_map, here, 0).xyz;
    share = 1.0;
    if (dot(normal, normal) == 0.0) return;
    vec3 view = perspective > 0.5 ? normalize(-point) : vec3(0.0, 0.0, 1.0);
    vec3 right = normalize(cross(vec3(0.0, 1.0, 0.0), view)), up = cross(view, right);
    float side = pixel * (perspective > 0.5 ? -point.z : 1.0);
    float growth = pow(max(reach / (side * NEAREST), 1.0), 1.0 / float(steps)), half_step = sqrt(growth);
    float turn = noise(gl_FragCoord.xy, 0.0), shift = noise(gl_FragCoord.xy, 1.0), rounding = noise(gl_FragCoord.xy, 2.0);
    float open = 0.0, whole = 0.0;
    for (int i = 0; i < slices; ++i) {
        float angle = PI * (float(i) + turn) / float(slices);
        vec3 along = cos(angle) * right + sin(angle) * up;
        vec3 flat_normal = normal - cross(view, along) * dot(normal, cross(view, along));
        float lengths = length(flat_normal);
        if (lengths < 1e-4) continue;
        float turned = atan(dot(flat_normal, along), dot(flat_normal, view));
        vec2 step_of = normalize(along.xy + perspective * along.z * point.xy / max(-point.z, 1e-6)); // on the screen
        float before = arc(turned - 0.5 * PI, turned), total = before + arc(turned + 0.5 * PI, turned);
        uint hidden = 0u;
        for (int s = -1; s <= 1; s += 2) {
            float radius = NEAREST * pow(growth, fract(shift + GOLDEN * float(2 * i + (s + 1) / 2)));
            for (int k = 0; k < steps; ++k, radius *= growth) {
                vec2 away = float(s) * step_of, place = vec2(here) + 0.5 + radius * away;
                if (!(all(greaterThanEqual(place, vec2(0.0))) && all(lessThan(place, size)))) break;
                ivec2 there = ivec2(place);
                vec3 hit = texelFetch(position_map, there, 0).xyz, off = hit - point;
                if (!(dot(off, normal) > FACETS * length(off))) continue;
                vec3 plate = texelFetch(normal_map, there, 0).xyz;
                if (dot(plate, plate) == 0.0) continue; // nothing is there
                float thickness = texelFetch(back_map, there, 0).r + hit.z;
                if (!(thickness > 0.0)) thickness = ENDLESS;
                float low = PI, high = -PI; // angles from the line of sight
                for (int e = 0; e < 2; ++e) {
                    vec2 end = vec2(here) + 0.5 + radius * (e == 0 ? 1.0 / half_step : half_step) * away;
                    vec3 ray = at_depth(end, 1.0), origin = vec3(0.0);
                    if (perspective < 0.5) { origin = vec3(ray.xy, 0.0); ray = vec3(0.0, 0.0, -1.0); }
                    float facing = dot(plate, ray), most = STEEPEST * radius * side * (half_step - 1.0);
                    float front = facing < 0.0 ? dot(plate, hit - origin) / facing : -hit.z;
                    front = clamp(front, -hit.z - most, -hit.z + most);
                    for (int b = 0; b < 2; ++b) {
                        vec3 apart = at_depth(end, front + (b == 0 ? 0.0 : thickness)) - point;
                        float seen_at = atan(max(float(s) * dot(apart, along), 0.0), dot(apart, view));
                        low = min(low, seen_at);
                        high = max(high, seen_at);
                    }
                }
                float limit = 0.5 * PI + float(s) * turned; // of the horizon
                low = min(low, limit);
                high = min(high, limit);
                if (!(high > low)) continue;
                float from = (before + float(s) * arc(float(s) * low, turned)) / total;
                float to = (before + float(s) * arc(float(s) * high, turned)) / total;
                hidden |= bits_between(SECTORS * min(from, to) + rounding, SECTORS * max(from, to) + rounding);
            }
        }
        open += lengths * total * (1.0 - counted(hidden) / SECTORS);
        whole += lengths * total;
    }
    share = whole > 0.0 ? open / whole : 1.0;
}
