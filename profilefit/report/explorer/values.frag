// The law's own functions at arguments of which each pixel has one: r [mm], alpha [-], mfp [mm].
precision highp int;
uniform highp sampler2D arguments;
out uvec4 found; // bits of R_d [1/mm^2] and cdf [-]

void main() {
    vec4 q = texelFetch(arguments, ivec2(gl_FragCoord.xy), 0);
    found = floatBitsToUint(vec4(law_profile(q.x, q.y, q.z), law_cdf(q.x, q.y, q.z), 0.0, 0.0));
}
