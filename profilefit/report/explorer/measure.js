// What a law gives at three albedos by its own text on the GPU, against the exact half space.
const NEAREST = 0.01, WITHIN = 0.995, RADII = 400, DRAWN = 256, COLUMNS = 321, EDGE = 3.5; // the first three as in quality.py

function spaced(low, high, count) {
  const ratio = Math.log(high / low) / (count - 1);
  return Float64Array.from({ length: count }, (_, i) => low * Math.exp(ratio * i));
}

// 1, 2 or 5 times a power of ten, not less than a number.
function round125(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return power * [1, 2, 5, 10].find((digit) => digit * power >= value * 0.999);
}

class Measurement {
  // programs: those of the law, of values.frag and edge.frag; state: A and mfp [mm] of each channel.
  constructor(device, programs, table, state) {
    const most = table.reflectance(1); // a surface that refracts keeps some light out
    this.channels = state.reflectance.map((asked, c) => {
      const reflectance = Math.min(asked, most), alpha = table.alphaOf(reflectance), exact = table.curve(alpha);
      return { reflectance, alpha, mfp: state.mfp[c], exact, outer: exact.quantile(WITHIN) };
    });
    this.profiles(device, programs.values);
    this.edges(device, programs.edge);
  }

  profiles(device, program) {
    const first = NEAREST * Math.min(...this.channels.map((one) => one.mfp));
    const last = 1.6 * Math.max(...this.channels.map((one) => one.outer * one.mfp));
    const rows = [];
    for (const one of this.channels) {
      one.r = spaced(first, last, DRAWN);
      one.near = spaced(NEAREST, one.outer, RADII);
      one.far = spaced(1e-4, 20 * one.outer, 4 * RADII);
      for (const r of one.r) rows.push([r, one.alpha, one.mfp]);
      for (const x of one.near) rows.push([x, one.alpha, 1]);
      for (const x of one.far) rows.push([x, one.alpha, 1]);
    }
    const found = device.evaluate(program, rows);
    let at = 0;
    const column = (count, which) => Float64Array.from({ length: count }, (_, i) => found[4 * (at + i) + which]);
    for (const one of this.channels) {
      one.profile = column(DRAWN, 0);
      one.cdf = column(DRAWN, 1);
      at += DRAWN;
      one.rel = average(column(RADII, 0).map((value, i) => Math.abs(value / one.exact.profile(one.near[i]) - 1)));
      at += RADII;
      one.ks = Math.max(...column(4 * RADII, 1).map((value, i) => Math.abs(value - one.exact.cdf(one.far[i]))));
      at += 4 * RADII;
      one.exactProfile = one.r.map((r) => one.exact.profile(r / one.mfp) / one.mfp ** 2);
      one.exactCdf = one.r.map((r) => one.exact.cdf(r / one.mfp));
    }
  }

  edges(device, program) {
    this.reach = round125(EDGE * Math.max(...this.channels.map((one) => one.mfp)));
    this.x = Float64Array.from({ length: COLUMNS }, (_, i) => this.reach * (2 * (i + 0.5) / COLUMNS - 1));
    // What is drawn shares its places [mm] with the other channels; the error is of places within EDGE of its own mfp.
    const own = this.x.map((x) => EDGE * x / this.reach);
    const rows = this.channels.flatMap((one) => [
      ...Array.from(this.x, (x) => [x, one.alpha, one.mfp]), ...Array.from(own, (x) => [x, one.alpha, 1]),
    ]);
    const found = device.evaluate(program, rows);
    this.channels.forEach((one, c) => {
      const column = (which) => this.x.map((_, i) => found[4 * ((2 * c + which) * COLUMNS + i)]);
      one.edge = column(0);
      one.exactEdge = this.x.map((x) => one.exact.edge(x / one.mfp));
      one.edgeError = Math.max(...column(1).map((value, i) => Math.abs(value - one.exact.edge(own[i]))));
    });
  }
}

function average(values) {
  return values.reduce((sum, value) => sum + value, 0) / values.length;
}
