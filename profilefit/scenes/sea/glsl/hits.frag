// Each vertex of a lattice over the surface: how far from below its place its light lands, as seen from a calm sea's
// ray, along x and y [m]; its flux per horizontal area; and the length of its way in the water [m].
in vec2 where;
out vec4 hit;
uniform sampler2D sea_map;  // z, dz/dx and dz/dy of the vertices
uniform sampler2D floor_waves;
uniform float tile;
uniform vec3 sun;
uniform float n;
uniform vec3 bed;  // mean, lowest and highest level of the floor [m]
uniform vec2 calm;  // where a calm sea's ray lands [m]
uniform int steps;

vec3 floor_at(vec2 place) {
    vec3 ground = waves_at(floor_waves, tile, place);
    return vec3(bed.x + ground.x, ground.yz);
}

void main() {
    vec2 place = 0.5 * (where + 1.0) * tile;
    vec3 water = texelFetch(sea_map, ivec2(gl_FragCoord.xy), 0).xyz;
    vec4 ray = refracted(sun, water.yz, n);
    float k = (bed.x - water.x) / ray.z;
    if (bed.y < bed.z) k = first_hit(vec3(place, water.x), ray.xyz, bed.y, bed.z, steps);
    hit = vec4(k * ray.xy - calm, ray.w, k);
}
