// The share of each triangle that lies on this pixel, exactly.
flat in vec4 first;
flat in vec4 last;
flat in vec2 light;
out float deposit;
const float LEAST = 2e-3;  // of twice a triangle's area [pixels^2]: a thinner one is widened to that

// Area below an edge and above y = 0 within the unit square, signed by its direction along x.
float below(vec2 a, vec2 b) {
    float left = clamp(a.x, 0.0, 1.0), right = clamp(b.x, 0.0, 1.0);
    if (left == right) return 0.0;
    float rise = (b.y - a.y) / (b.x - a.x);
    float start = a.y + (left - a.x) * rise, end = a.y + (right - a.x) * rise;
    float low = min(start, end), high = max(start, end);
    float from = clamp(low, 0.0, 1.0), to = clamp(high, 0.0, 1.0);
    float span = high - low;
    float mean = span > 1e-6 ? (0.5 * (to - from) * (to + from) + max(high - max(low, 1.0), 0.0)) / span : from;
    return mean * (right - left);
}

float share(vec2 a, vec2 b, vec2 c) {
    vec2 one = b - a, other = c - a;
    float area = one.x * other.y - one.y * other.x;
    if (abs(area) < LEAST) {
        // The corner across from the longest side moves away from it.
        vec2 third = c - b;
        float ab = dot(one, one), ac = dot(other, other), bc = dot(third, third);
        vec2 longest = ab >= ac && ab >= bc ? one : ac >= bc ? -other : third;
        float size = length(longest);
        vec2 away = size > 1e-6 ? vec2(-longest.y, longest.x) / size : vec2(0.0, 1.0);
        float lift = ((area < 0.0 ? -LEAST : LEAST) - area) / max(size, 0.05);
        if (size < 0.05) {
            a -= vec2(0.025, 0.0);
            b += vec2(0.025, 0.0);
            c += vec2(0.0, 0.04);
        } else if (ab >= ac && ab >= bc) c += lift * away;
        else if (ac >= bc) b += lift * away;
        else a += lift * away;
        area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    }
    return 2.0 * (below(b, a) + below(c, b) + below(a, c)) / area;
}

void main() {
    vec2 corner = floor(gl_FragCoord.xy);
    vec2 a = first.xy - corner, b = first.zw - corner, c = last.xy - corner, d = last.zw - corner;
    deposit = light.x * share(a, b, c) + light.y * share(a, c, d);
}
