// A stack of layers, of which the first one's thickness d is an argument: the half space of the first layer, less what
// of it went deeper, plus what came back from below, plus an image,
//     R_d = R_1(r) - c_1 R_1(s_1) + c_2 R_2(s_2) + m I(r),  s_i^2 = r^2 + (g_i d)^2,
// R_2 the half space of the second layer or, of more of them, the same again. x = r / l, and all lengths here are in
// mean free paths l of the first layer.

#ifndef STACK_STEPS
#define STACK_STEPS 3 // of Newton's method for the radius of an image: right to 9e-6 of its share
#endif

#ifndef PF_STACK
#define PF_STACK
// What an interface makes of the light of the layer above it. Depths g_i d, and height and rate of the image.
struct PfEdge {
    float gone; // [mfp]
    float back; // [mfp]
    float lost; // c_1 [-]
    float came; // c_2 [-]
    float height; // [mfp]
    float rate; // [1/mfp]
    float image; // m [-]
    float passed; // share of R_1 within r = gone [-]
    float began; // energy of R_2 within r = back [-]
    float first; // of all radii that are drawn those of R_1 [-]
    float second; // and those of R_2
};

float pf_beside(float x, float depth) {
    return max(sqrt(x * x + depth * depth), x);
}

// 2 pi I [1/mfp^2]
float pf_image(float x, float height, float rate) {
    float s = pf_beside(x, height);
    return height * (1.0 + rate * s) * exp(rate * (height - s)) / (s * s * s);
}

// Share of the image's light beyond x [-]
float pf_image_beyond(float x, float height, float rate) {
    float s = pf_beside(x, height);
    return height / s * exp(rate * (height - s));
}

// x beyond which a share of its light is, for 1 - xi of that share: z + ln z = q for z = rate s.
float pf_image_radius(float xi, float height, float rate) {
    float nearest = rate * height;
    float q = nearest + log(nearest) - log(1.0 - xi);
    float z = PF_SELECT(q > 1.0, q - log(max(q, 1.0)), exp(min(q, 1.0) - 0.5));
    for (int i = 0; i < STACK_STEPS; ++i) {
        z = z * (1.0 + q - log(z)) / (1.0 + z);
    }
    float s = z / rate;
    return sqrt(max((s - height) * (s + height), 0.0));
}
#endif

struct LAW_Shape {
    float reflectance; // A [-]
    float mfp; // l [length]
//% for 1
    float scale@i; // l over the mean free path of layer @i
    LAW_layer_Shape layer@i;
//% end
//% for 2
    PfEdge edge@h; // between layers @h and @i
//% end
};

// 2 pi R_d of a layer's half space [1/mfp^2]
float LAW_layer_ring(float x, float scale, LAW_layer_Shape s) {
    return LAW_layer_reflectance(s) * scale * LAW_layer_density(x * scale, s) / x;
}

// The same, of what a layer adds by itself: all but what came back from below.
float LAW_edge_ring(float x, float scale, LAW_layer_Shape s, PfEdge e) {
    float gone = LAW_layer_ring(pf_beside(x, e.gone), scale, s);
    return LAW_layer_ring(x, scale, s) - e.lost * gone + e.image * pf_image(x, e.height, e.rate);
}

// Its light within x [-]
float LAW_edge_within(float x, float scale, LAW_layer_Shape s, PfEdge e) {
    float gone = LAW_layer_cumulated(pf_beside(x, e.gone) * scale, s) - e.passed;
    float own = LAW_layer_reflectance(s) * (LAW_layer_cumulated(x * scale, s) - e.lost * gone);
    return own + e.image * (1.0 - pf_image_beyond(x, e.height, e.rate));
}

// 2 pi R_2 [1/mfp^2]
float LAW_below_ring(float x, LAW_Shape s) {
    float sum = 0.0;
    float at2 = x;
    float part2 = 1.0;
//% for 3
    sum = sum + part@h * LAW_edge_ring(at@h, s.scale@h, s.layer@h, s.edge@h);
    float at@i = pf_beside(at@h, s.edge@h.back);
    float part@i = part@h * s.edge@h.came;
//% end
    return sum + part@n * LAW_layer_ring(at@n, s.scale@n, s.layer@n);
}

// Light of R_2 within x [-]
float LAW_below_within(float x, LAW_Shape s) {
    float sum = 0.0;
    float at2 = x;
    float part2 = 1.0;
//% for 3
    float own@h = LAW_edge_within(at@h, s.scale@h, s.layer@h, s.edge@h);
    sum = sum + part@h * (own@h - s.edge@h.came * s.edge@h.began);
    float at@i = pf_beside(at@h, s.edge@h.back);
    float part@i = part@h * s.edge@h.came;
//% end
    return sum + part@n * LAW_layer_reflectance(s.layer@n) * LAW_layer_cumulated(at@n * s.scale@n, s.layer@n);
}

// All that depends on channel and thickness only: once a point of the surface. Thickness in the unit of l.
LAW_Shape LAW_shape(float channel, float thickness) {
    LAW_Shape s;
    s.mfp = LAW_of(channel, LAW_red_mfp, LAW_green_mfp, LAW_blue_mfp);
//% for 1
    s.scale@i = LAW_of(channel, LAW_red_scale@i, LAW_green_scale@i, LAW_blue_scale@i);
    s.layer@i = LAW_layer@i(channel);
//% end
//% for 3
    PfEdge edge@h;
    edge@h.gone = LAW_of(channel, LAW_red_gone@h, LAW_green_gone@h, LAW_blue_gone@h);
    edge@h.back = LAW_of(channel, LAW_red_back@h, LAW_green_back@h, LAW_blue_back@h);
    edge@h.lost = LAW_of(channel, LAW_red_lost@h, LAW_green_lost@h, LAW_blue_lost@h);
    edge@h.came = LAW_of(channel, LAW_red_came@h, LAW_green_came@h, LAW_blue_came@h);
    edge@h.height = LAW_of(channel, LAW_red_height@h, LAW_green_height@h, LAW_blue_height@h);
    edge@h.rate = LAW_of(channel, LAW_red_rate@h, LAW_green_rate@h, LAW_blue_rate@h);
    edge@h.image = LAW_of(channel, LAW_red_image@h, LAW_green_image@h, LAW_blue_image@h);
    edge@h.passed = LAW_of(channel, LAW_red_passed@h, LAW_green_passed@h, LAW_blue_passed@h);
    edge@h.began = LAW_of(channel, LAW_red_began@h, LAW_green_began@h, LAW_blue_began@h);
    edge@h.first = LAW_of(channel, LAW_red_first@h, LAW_green_first@h, LAW_blue_first@h);
    edge@h.second = LAW_of(channel, LAW_red_second@h, LAW_green_second@h, LAW_blue_second@h);
    s.edge@h = edge@h;
//% end
    float x = clamp(thickness / s.mfp, 0.0, 1e6);
    float above = LAW_layer_reflectance(s.layer1);
    float below = LAW_of(channel, LAW_red_below, LAW_green_below, LAW_blue_below);
    float w = LAW_of(channel, LAW_red_w, LAW_green_w, LAW_blue_w);
    float open = LAW_of(channel, LAW_red_open, LAW_green_open, LAW_blue_open);
    float early = LAW_of(channel, LAW_red_u, LAW_green_u, LAW_blue_u) * LAW_faded(x);
    float t = 2.0 * LAW_of(channel, LAW_red_kappa, LAW_green_kappa, LAW_blue_kappa) * x + early;
    PfEdge edge;
    edge.gone = LAW_of(channel, LAW_red_g1, LAW_green_g1, LAW_blue_g1) * x;
    edge.back = LAW_of(channel, LAW_red_g2, LAW_green_g2, LAW_blue_g2) * x;
    edge.lost = exp(-LAW_of(channel, LAW_red_b1, LAW_green_b1, LAW_blue_b1) * x);
    edge.came = exp(-LAW_of(channel, LAW_red_b2, LAW_green_b2, LAW_blue_b2) * x);
    float rise = LAW_of(channel, LAW_red_h1, LAW_green_h1, LAW_blue_h1);
    edge.height = LAW_of(channel, LAW_red_h0, LAW_green_h0, LAW_blue_h0) + rise * x;
    float faster = max(LAW_of(channel, LAW_red_k0, LAW_green_k0, LAW_blue_k0), 1e-9 / edge.height);
    edge.rate = LAW_of(channel, LAW_red_slowest, LAW_green_slowest, LAW_blue_slowest) + faster;
    edge.passed = LAW_layer_cumulated(edge.gone, s.layer1);
    edge.began = LAW_below_within(edge.back, s);
    s.reflectance = above + (below - above) * open * exp(-t) / (open + w * LAW_faded(t));
    float kept = above - edge.lost * above * (1.0 - edge.passed);
    float brought = edge.came * max(below - edge.began, 0.0);
    edge.image = s.reflectance - kept - brought;
    float all = kept + brought + max(edge.image, 0.0);
    edge.first = 1.0 - (brought + max(edge.image, 0.0)) / max(all, PF_NEAREST);
    edge.second = brought / max(all, PF_NEAREST);
    s.edge1 = edge;
    return s;
}

float LAW_reflectance(LAW_Shape s) {
    return s.reflectance;
}

// 2 pi x R_d / A [1/mfp]
float LAW_density(float x, LAW_Shape s) {
    float near = clamp(x, PF_NEAREST, PF_FARTHEST);
    float below = s.edge1.came * LAW_below_ring(pf_beside(near, s.edge1.back), s);
    float light = near * (LAW_edge_ring(near, 1.0, s.layer1, s.edge1) + below);
    return max(light, 0.0) / max(s.reflectance, PF_NEAREST);
}

// Share of the energy within x [-]
float LAW_cumulated(float x, LAW_Shape s) {
    float near = clamp(x, PF_NEAREST, PF_FARTHEST);
    float below = LAW_below_within(pf_beside(near, s.edge1.back), s) - s.edge1.began;
    float light = LAW_edge_within(near, 1.0, s.layer1, s.edge1) + s.edge1.came * below;
    return clamp(light / max(s.reflectance, PF_NEAREST), 0.0, 1.0);
}

// x for a uniform number xi: of a term that adds light, chosen by its share, a radius of its own law, seen from its
// depth. Chosen first, so that but one radius of a layer and one of an image are worked out.
float LAW_radius(float xi, LAW_Shape s) {
    float share1 = clamp(xi, 0.0, PF_MOST_XI);
    float depth1 = 0.0;
    LAW_layer_Shape layer = s.layer1;
    float scale = 1.0;
    float height = 1.0;
    float rate = 1.0;
    float inner = 0.0;
    float depth = 0.0;
    float mirrored = 0.0;
    float open = 1.0;
//% for 2
    float most@h = s.edge@h.first + s.edge@h.second;
    float of_image@h = PF_SELECT(share@h < most@h, 0.0, open);
    float ends@h = PF_SELECT(share@h < s.edge@h.first, open, of_image@h);
    float low@h = PF_SELECT(of_image@h > 0.5, most@h, 0.0);
    float width@h = PF_SELECT(of_image@h > 0.5, 1.0 - most@h, s.edge@h.first);
    inner = PF_SELECT(ends@h > 0.5, (share@h - low@h) / max(width@h, PF_NEAREST), inner);
    depth = PF_SELECT(ends@h > 0.5, depth@h, depth);
    height = PF_SELECT(of_image@h > 0.5, s.edge@h.height, height);
    rate = PF_SELECT(of_image@h > 0.5, s.edge@h.rate, rate);
    mirrored = PF_SELECT(of_image@h > 0.5, 1.0, mirrored);
    open = PF_SELECT(ends@h > 0.5, 0.0, open);
    layer = LAW_layer_either(open, s.layer@i, layer);
    scale = PF_SELECT(open > 0.5, s.scale@i, scale);
    float share@i = (share@h - s.edge@h.first) / max(s.edge@h.second, PF_NEAREST);
    float depth@i = pf_beside(depth@h, s.edge@h.back);
//% end
    inner = clamp(PF_SELECT(open > 0.5, share@n, inner), 0.0, PF_MOST_XI);
    depth = PF_SELECT(open > 0.5, depth@n, depth);
    float own = LAW_layer_radius(inner, layer) / scale;
    float x = PF_SELECT(mirrored > 0.5, pf_image_radius(inner, height, rate), own);
    return sqrt(x * (x + 2.0 * depth)); // what lies beyond x of a law, seen from a depth
}

// Density in x of LAW_radius [1/mfp]: not that of the law, which also takes light away.
float LAW_radius_density(float x, LAW_Shape s) {
    float near = clamp(x, PF_NEAREST, PF_FARTHEST);
    float sum = 0.0;
    float part1 = 1.0;
    float depth1 = 0.0;
//% for 2
    float far@h = pf_beside(near, depth@h);
    float at@h = near / (far@h + depth@h) * near;
    float own@h = s.scale@h * LAW_layer_radius_density(at@h * s.scale@h, s.layer@h);
    float third@h = max(1.0 - s.edge@h.first - s.edge@h.second, 0.0);
    float seen@h = at@h * pf_image(at@h, s.edge@h.height, s.edge@h.rate);
    sum = sum + part@h * (s.edge@h.first * own@h + third@h * seen@h) * near / far@h;
    float part@i = part@h * s.edge@h.second;
    float depth@i = pf_beside(depth@h, s.edge@h.back);
//% end
    float far@n = pf_beside(near, depth@n);
    float at@n = near / (far@n + depth@n) * near;
    return sum + part@n * s.scale@n * LAW_layer_radius_density(at@n * s.scale@n, s.layer@n) * near / far@n;
}

// In lengths, any unit: that of l.

// R_d [1/length^2]: 2 pi r R_d integrates to A
float LAW_profile(float r, float channel, float thickness) {
    LAW_Shape s = LAW_shape(channel, thickness);
    float x = max(r / s.mfp, PF_LEAST_X);
    return s.reflectance * LAW_density(x, s) / (PF_TWO_PI * x) / (s.mfp * s.mfp);
}

// Share of the reflected energy within r [-]
float LAW_cdf(float r, float channel, float thickness) {
    LAW_Shape s = LAW_shape(channel, thickness);
    return LAW_cumulated(r / s.mfp, s);
}

// Radius [length] for a uniform number xi in [0, 1]
float LAW_sample(float xi, float channel, float thickness) {
    LAW_Shape s = LAW_shape(channel, thickness);
    return LAW_radius(xi, s) * s.mfp;
}

// Density [1/length] of LAW_sample
float LAW_pdf(float r, float channel, float thickness) {
    LAW_Shape s = LAW_shape(channel, thickness);
    return LAW_radius_density(r / s.mfp, s) / s.mfp;
}

// Reflectance A [-]
float LAW_total(float channel, float thickness) {
    LAW_Shape s = LAW_shape(channel, thickness);
    return s.reflectance;
}
