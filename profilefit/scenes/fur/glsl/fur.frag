// The first strand that each ray meets, layer by layer: on shells, or within swept slabs.
uniform vec3 eye, forward, right, up;
uniform float parallel, radius, exponent;
uniform int layers, tested;  // strands of a slab; 0: shells
uniform bool walked;  // in even steps, as many as layers where the way over the skin is a strand's length
in vec2 where;
out vec4 found;  // foot and height over the length; the skin's normal and -1; -2

// Height over the length, and place across a strand's axis.
float across(Strand s, vec3 p, out vec3 q) {
    vec3 axis = tall * s.axis;
    vec3 away = p - s.foot;
    float t = dot(away, s.up) / dot(axis, s.up);
    q = away - t * axis;
    return t;
}

bool on_shell(vec3 p, float t) {
    Strand s = strand_near(p, t, 0);
    bool hit = length(p - s.foot - t * tall * s.axis) < radius * strand_slice(t, exponent);
    if (hit) found = vec4(s.foot, t);
    return hit;
}

// The nearest strands to the middle of the way from `begin` to `end`, wherever along the ray they are met.
bool in_slab(vec3 o, vec3 d, float begin, float end, float skin) {
    float middle = 0.5 * (begin + end);
    vec3 p = o + middle * d;
    float t_middle = height_of(p);
    float best = skin;
    bool hit = false;
    for (int which = 0; which < tested; ++which) {
        Strand s = strand_near(p, t_middle, which);
        vec3 q, m, axis = tall * s.axis;
        float t = across(s, p, q);
        float rate = dot(d, s.up) / dot(axis, s.up);
        m = d - rate * axis;
        vec3 x = normalize(cross(s.up, abs(s.up.z) < 0.7 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0)));
        vec3 y = cross(s.up, x);
        float far = strand_swept(dot(q, x), dot(q, y), dot(m, x), dot(m, y), radius * (1.0 - t), -radius * rate);
        float height = t + far * rate;
        if (far < NONE && height >= 0.0 && height <= 1.0 && middle + far > 0.0 && middle + far < best) {
            best = middle + far;
            found = vec4(s.foot, height);
            hit = true;
        }
    }
    return hit;
}

void main() {
    vec3 aside = where.x * right + where.y * up;
    vec3 o = eye + parallel * aside;
    vec3 d = normalize(forward + (1.0 - parallel) * aside);
    float skin = level(o, d, 0.0).x;
    found = skin < NONE ? vec4(normal_at(o + skin * d), -1.0) : vec4(-2.0);
    float begin = level(o, d, 1.0).x;
    if (begin >= NONE) return;
    if (walked) {
        float end = skin < NONE ? skin : level(o, d, 1.0).y;
        float way = crossed(o + begin * d, o + end * d);
        int steps = int(clamp(ceil(float(layers) * way / tall), 1.0, 4096.0));
        float one = (end - begin) / float(steps);
        for (int i = 0; i < steps; ++i) {
            if (in_slab(o, d, begin + float(i) * one, begin + float(i + 1) * one, skin)) return;
        }
        return;
    }
    int i = layers - 1;
    for (; i >= 0; --i) {
        float t = float(i) / float(layers);
        float here = level(o, d, t).x;
        bool through = here < NONE;
        if (tested > 0) {
            float end = through ? here : level(o, d, float(i + 1) / float(layers)).y;
            if (in_slab(o, d, begin, end, skin)) return;
            begin = here;
        } else if (through && on_shell(o + here * d, t)) {
            return;
        }
        if (!through) break;
    }
    if (skin < NONE) return;
    // Past the skin, and out again.
    for (++i; i < layers; ++i) {
        float t = float(i) / float(layers);
        float here = level(o, d, t).y;
        if (tested > 0) {
            if (in_slab(o, d, here, level(o, d, float(i + 1) / float(layers)).y, skin)) return;
        } else if (on_shell(o + here * d, t)) {
            return;
        }
    }
}
