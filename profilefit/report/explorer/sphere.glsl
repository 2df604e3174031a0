precision highp int;
const float FILLED = 0.94; // of the picture's side, by the ball

// Towards the viewer; beyond the rim that of the rim.
vec3 ball_normal(vec2 pixel, float side) {
    vec2 place = (2.0 * pixel - side) / (FILLED * side);
    place /= max(length(place), 1.0);
    return vec3(place, sqrt(max(1.0 - dot(place, place), 0.0)));
}

float irradiance(vec3 normal, vec3 toward_light, float even) {
    return mix(max(dot(normal, toward_light), 0.0), 1.0, even);
}
