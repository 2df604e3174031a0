// Irradiance of an environment by the normal in the world.
uniform vec3 harmonics[9]; // of 1, y, z, x, xy, yz, 3 z^2 - 1, zx, x^2 - y^2

vec3 by_harmonics(vec3 n) {
    vec3 even = harmonics[4] * n.x * n.y + harmonics[5] * n.y * n.z + harmonics[7] * n.z * n.x;
    even += harmonics[6] * (3.0 * n.z * n.z - 1.0) + harmonics[8] * (n.x * n.x - n.y * n.y);
    return max(harmonics[0] + harmonics[1] * n.y + harmonics[2] * n.z + harmonics[3] * n.x + even, 0.0);
}
