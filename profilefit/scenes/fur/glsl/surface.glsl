// What every surface of fur has: maps of feet, the tips' force by the length, and the strands' length.
uniform sampler2D nearest_map, next_map;
uniform vec3 force;
uniform float tall;

const float NONE = 1e8;  // no such place along a ray

struct Strand { vec3 foot; vec3 up; vec3 axis; };  // the axis from foot to tip, by the length
