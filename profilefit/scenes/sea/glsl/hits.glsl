// Where a ray from `origin` along the unit vector `along` comes through the surface of `floor_at` from above.
// As profilefit.scenes.sea.waves: equal steps, the first change of sign or dip, then Newton within the bracket.
const int NEWTON = 3;

// z, dz/dx and dz/dy of the surface at a place: the shader that includes this text has it.
vec3 floor_at(vec2 place);

// How far the ray is above the surface after a distance k, and the change of that with k.
vec2 gap_at(vec3 origin, vec3 along, float k) {
    vec3 place = origin + k * along;
    vec3 ground = floor_at(place.xy);
    return vec2(place.z - ground.x, along.z - dot(ground.yz, along.xy));
}

// Plain iterations from the plane z = level: right where largest slope x tan(ray to the vertical) < 1.
float newton_hit(vec3 origin, vec3 along, float level, int iterations) {
    float k = (level - origin.z) / along.z;
    for (int i = 0; i < iterations; ++i) {
        vec2 gap = gap_at(origin, along, k);
        k -= gap.x / gap.y;
    }
    return k;
}

// Distance to the first hit between two planes that the surface keeps to, or -1 where the ray does not descend. At the
// lower plane every ray has come through, also where float32 rounds a level surface to above it.
float first_hit(vec3 origin, vec3 along, float lowest, float highest, int steps) {
    if (along.z >= 0.0 || origin.z < lowest) return -1.0;
    float near = max((highest - origin.z) / along.z, 0.0);
    float far = (lowest - origin.z) / along.z;
    far += 1e-6 * (far + highest - lowest);
    float width = (far - near) / float(steps);
    float start = near, end = -1.0;
    vec2 before = gap_at(origin, along, near);
    float above = max(before.x, 0.0), below = 0.0;
    for (int i = 1; i <= steps; ++i) {
        float here = near + float(i) * width;
        vec2 gap = gap_at(origin, along, here);
        if (gap.x < 0.0) {
            end = here;
            below = gap.x;
            break;
        }
        if (before.y < 0.0 && gap.y > 0.0) {
            // The lowest place of the cubic with these values and rates.
            float rise = gap.x - above, begins = before.y * width, ends = gap.y * width;
            float linear = 3.0 * rise - 2.0 * begins - ends, cubic = begins + ends - 2.0 * rise;
            float share = -begins / (linear + sqrt(max(linear * linear - 3.0 * cubic * begins, 0.0)));
            float dip = start + clamp(share, 0.0, 1.0) * width;
            float under = gap_at(origin, along, dip).x;
            if (under < 0.0) {
                end = dip;
                below = under;
                break;
            }
        }
        if (i == steps) {
            end = here;
            break;
        }
        start = here;
        above = gap.x;
        before = gap;
    }
    float k = start + (above > below ? above / (above - below) : 0.0) * (end - start);
    for (int i = 0; i < NEWTON; ++i) {
        vec2 gap = gap_at(origin, along, k);
        if (gap.x >= 0.0) start = k; else end = k;
        float next = k - gap.x / gap.y;
        k = next >= start && next <= end ? next : 0.5 * (start + end);
    }
    return k;
}
