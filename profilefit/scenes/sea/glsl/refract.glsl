// The sun's light behind a surface of a given slope: the ray (unit vector), and in w its flux per horizontal area,
// over that of the sun across its rays. As profilefit.scenes.sea.waves.refracted.
vec4 refracted(vec3 sun, vec2 slope, float n) {
    float stretch = sqrt(1.0 + dot(slope, slope));
    vec3 normal = vec3(-slope, 1.0) / stretch;
    float outside = max(-dot(sun, normal), 0.0);
    float inside = sqrt(max(1.0 - (1.0 - outside * outside) / (n * n), 0.0));
    float across = (outside - n * inside) / (outside + n * inside);
    float along = (n * outside - inside) / (n * outside + inside);
    float transmitted = 1.0 - 0.5 * (across * across + along * along);
    return vec4(sun / n + (outside / n - inside) * normal, transmitted * outside * stretch);
}
