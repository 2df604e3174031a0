#ifndef PF_COMMON
#define PF_COMMON
// A choice between two numbers, both of which are computed.
#define PF_SELECT(condition, yes, no) ((condition) ? (yes) : (no))
const float PF_TWO_PI = 6.283185307179586;
const float PF_NEAREST = 1e-25; // x = r/l [mfp] that stands for 0 in quotients
const float PF_FARTHEST = 1e8; // and for infinity: no light is left there
const float PF_LEAST_X = 1e-6; // nearer to the source R_d is taken here, where it still is finite
const float PF_MOST_XI = 0.99999994; // 1 - 2^-24: a radius drawn at xi = 1 is finite
#endif
