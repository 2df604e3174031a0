// Random cones, of a radius at the root and a length; z and t are heights over the length, 0 at the skin.

// Area that one hides of the skin, seen aslant [length^2]: the hull of its root's disc and of its tip, which is
// seen `aside` of the root: length tan(theta), or |length (tan(theta) v - lean)|. No digits are lost at any angle.
float strand_shadow(float radius, float aside) {
    float u = sqrt(max((aside - radius) * (aside + radius), 0.0)) / radius;
    return radius * radius * (0.5 * PF_TWO_PI + u - atan(u));
}

// Area that one hides from an eye and from a lamp at once [length^2]; `turn` is the angle between the ways in which both
// see its tip aside, 0 to pi. Less it, a lamp's shadow is that on what an eye sees.
float strand_shared(float radius, float first, float second, float turn) {
    float one = sqrt(max((first - radius) * (first + radius), 0.0)) / radius;
    float two = sqrt(max((second - radius) * (second + radius), 0.0)) / radius;
    float t1 = 1.0 / (max(first / radius, 1.0) + one); // of half the angle at the tip, 1 within the disc
    float t2 = 1.0 / (max(second / radius, 1.0) + two);
    float across = (1.0 - t1 * t2) * sin(0.5 * turn) + (t1 + t2) * cos(0.5 * turn);
    float along = (1.0 - t1 * t2) * cos(0.5 * turn) - (t1 + t2) * sin(0.5 * turn);
    float u = clamp(along / across, 0.0, min(one, two));
    return radius * radius * (0.5 * PF_TWO_PI + u - atan(u));
}

// Chance that a ray meets none above z: toward the eye what is seen, toward the lamp the fur's shadow on itself.
float strand_visibility(float density, float shadow, float z) {
    float above = 1.0 - z;
    return exp(-density * shadow * above * above);
}

// Radius of its disc on a shell at t, over that of the root.
float strand_slice(float t, float exponent) {
    return 1.0 - pow(t, exponent);
}

// How far along a ray it comes into one, PF_FARTHEST if it does not: the first root of |q + m s| = r + k s where that
// is >= 0. q is the ray's place across the axis, r the radius at its height; m and k what they change a length of ray.
float strand_swept(float qx, float qy, float mx, float my, float r, float k) {
    float a = mx * mx + my * my - k * k;
    float b = qx * mx + qy * my - r * k;
    float c = qx * qx + qy * qy - r * r;
    float vx = r * mx - k * qx;
    float vy = r * my - k * qy;
    float across = qx * my - qy * mx;
    float under = vx * vx + vy * vy - across * across; // b^2 - a c, of which fewer digits would be left
    float root = sqrt(max(under, 0.0));
    float sum = -b - PF_SELECT(b < 0.0, -root, root);
    float slope = PF_SELECT(abs(a) < PF_NEAREST, 1.0, a);
    float one = PF_SELECT(abs(a) < PF_NEAREST, PF_FARTHEST, sum / slope); // parallel to its side it has one root
    float two = c / PF_SELECT(abs(sum) < PF_NEAREST, PF_NEAREST, sum);
    float near = min(one, two);
    float far = max(one, two);
    float first = PF_SELECT(r + k * near < 0.0, PF_SELECT(r + k * far < 0.0, PF_FARTHEST, far), near);
    return PF_SELECT(under < 0.0, PF_FARTHEST, clamp(first, -PF_FARTHEST, PF_FARTHEST));
}
