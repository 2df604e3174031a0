// Radiance of hits on a ball: of skin and strands in the fur's own shadow, with a rim and two lobes after Kajiya and Kay.
uniform sampler2D hit_map, occlusion_map;  // over height and lean
uniform vec3 forward, right, up, force, to_light, irradiance, ambient, colour, skin_colour, rim, background;
uniform vec2 exponents, turns, strengths;  // of the lobes; angles by which they are turned
uniform float radius, tall, density, widest;
in vec2 where;
out vec4 radiance;

const float PI = 3.14159265;

// A direction's part along the skin, over that along the normal.
vec3 aslant(vec3 toward, vec3 n) {
    float onto = dot(toward, n);
    return (toward - n * onto) / max(onto, 1e-4);
}

void main() {
    vec4 hit = texelFetch(hit_map, ivec2(gl_FragCoord.xy), 0);
    radiance = vec4(background, 1.0);
    if (hit.w < -1.5) return;
    vec3 n = normalize(hit.xyz);
    bool is_skin = hit.w < 0.0;
    float z = max(hit.w, 0.0);
    vec3 to_eye = -normalize(forward + where.x * right + where.y * up);
    // Locally the force leans a strand of some height along the normal.
    float stretch = 1.0 + dot(force, n);
    vec3 lean = (force - n * dot(force, n)) / stretch;
    float onto = dot(n, to_light);
    // What is seen is in a gap toward the eye, through which the lamp may shine, too.
    vec3 from_lamp = tall * stretch * (aslant(to_light, n) - lean), from_eye = tall * stretch * (aslant(to_eye, n) - lean);
    float turn = atan(length(cross(from_lamp, from_eye)), dot(from_lamp, from_eye) + 1e-12);
    float area = strand_shadow(radius, length(from_lamp));
    area = max(area - strand_shared(radius, length(from_lamp), length(from_eye), turn), 0.0);
    float lit = onto > 0.0 ? strand_visibility(density, area, z) : 0.0;  // a plane's fur hides what is under its horizon
    vec2 rows = vec2(textureSize(occlusion_map, 0));
    vec2 place = vec2(z * (rows.x - 1.0), length(lean) / widest * (rows.y - 1.0));
    float open = texture(occlusion_map, (place + 0.5) / rows).r;
    vec3 sky = ambient + by_harmonics(n);
    vec3 albedo = is_skin ? skin_colour : colour;
    float edge = clamp(rim.x + rim.y * pow(1.0 - clamp(dot(n, to_eye), 0.0, 1.0), rim.z), 0.0, 1.0);
    vec3 seen = albedo / PI * (irradiance * max(onto, 0.0) * lit + sky * open) + edge * open * sky / PI;
    if (!is_skin) {
        vec3 axis = normalize(n + force + gathered_at(n)), middle = normalize(to_eye + to_light);
        float angle = acos(clamp(dot(axis, middle), -1.0, 1.0));
        vec2 lobes = strengths * vec2(pow(abs(sin(angle - turns.x)), exponents.x), pow(abs(sin(angle - turns.y)), exponents.y));
        // The first is white; the other one went through the strand.
        seen += lit / (4.0 * PI) * irradiance * (lobes.x + lobes.y * colour);
    }
    radiance = vec4(seen, 1.0);
}
