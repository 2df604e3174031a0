// The exact half space from tables: six-point Lagrange polynomials over u and over ln x, x = r/l [mfp], where
// sqrt(1 - alpha) = 1 - (1 - u^3)^2 crowds the rows at both ends.
const POINTS = 6;
const UNDER = [-120, 24, -12, 12, -24, 120];

// The first of six knots around a place, 0 to count - 1, and their weights.
function lagrange(place, count, weights) {
  const first = Math.min(Math.max(Math.floor(place) - 2, 0), count - POINTS);
  const t = place - first;
  for (let i = 0; i < POINTS; ++i) {
    let product = 1;
    for (let j = 0; j < POINTS; ++j) if (j !== i) product *= t - j;
    weights[i] = product / UNDER[i];
  }
  return first;
}

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

// Numbers of three bytes, in steps from -32.
function fixedOf(base64) {
  const bytes = bytesOf(base64);
  return Float64Array.from({ length: bytes.length / 3 }, (_, i) =>
    4e-6 * (bytes[3 * i] + 256 * bytes[3 * i + 1] + 65536 * bytes[3 * i + 2]) - 32);
}

// kappa, the root of alpha artanh(kappa) = kappa [1/mfp]: kappa = tanh t, alpha t = tanh t.
function decayRate(alpha) {
  if (alpha <= 0) return 1;
  if (alpha >= 1) return 0;
  let low = 1e-9, high = 1 / alpha;
  for (let i = 0; i < 60; ++i) {
    const middle = 0.5 * (low + high);
    if (Math.tanh(middle) > alpha * middle) low = middle; else high = middle;
  }
  return Math.tanh(low);
}

class ExactTable {
  // rows, columns: of the table; low, high: its x; floats: A / alpha of each row, then two tables of rows.
  constructor({ rows, columns, low, high }, floats) {
    Object.assign(this, { rows, columns, low, high });
    const size = rows * columns;
    this.ratio = floats.subarray(0, rows);
    this.profile = floats.subarray(rows, rows + size);
    this.cdf = floats.subarray(rows + size, rows + 2 * size);
    this.weights = new Float64Array(POINTS);
  }

  // The polynomial through six numbers of a row of numbers.
  between(numbers, place, stride = 1, offset = 0, count = this.rows) {
    const first = lagrange(place, count, this.weights);
    let sum = 0;
    for (let i = 0; i < POINTS; ++i) sum += this.weights[i] * numbers[offset + stride * (first + i)];
    return sum;
  }

  // A [-]
  reflectance(alpha) {
    const s = Math.sqrt(Math.max(1 - alpha, 0));
    return alpha * this.between(this.ratio, this.rowOf(s));
  }

  rowOf(s) {
    return Math.cbrt(1 - Math.sqrt(Math.max(1 - s, 0))) * (this.rows - 1);
  }

  // alpha [-] for a total reflectance, by halvings of s.
  alphaOf(reflectance) {
    if (reflectance <= 0) return 0;
    if (reflectance >= 1) return 1;
    let low = 0, high = 1;
    for (let i = 0; i < 60; ++i) {
      const s = 0.5 * (low + high);
      if (this.reflectance(1 - s * s) > reflectance) low = s; else high = s;
    }
    return 1 - low * low;
  }

  curve(alpha) {
    return new ExactCurve(this, alpha);
  }
}

// The tables of one light: of n = 1, and of every other n, by a polynomial over mu_c = sqrt(1 - 1/n^2) through knots.
class ExactTables {
  constructor({ grids, knots }, [matched, ...refracting]) {
    Object.assign(this, { grids, knots, matched: new ExactTable(grids.matched, new Float32Array(bytesOf(matched).buffer)) });
    this.refracting = refracting.map(fixedOf);
    this.found = [1, this.matched]; // the last that was asked for
  }

  at(n) {
    if (n === 1) return this.matched;
    if (this.found[0] !== n) this.found = [n, this.between(n)];
    return this.found[1];
  }

  between(n) {
    const cosine = (index) => Math.sqrt(1 - 1 / index ** 2), places = this.knots.map(cosine), place = cosine(n);
    const weights = places.map((here) => places.reduce((product, other) =>
      (other === here ? product : product * (place - other) / (here - other)), 1));
    const floats = Float64Array.from(this.refracting[0], (_, i) =>
      weights.reduce((sum, weight, k) => sum + weight * this.refracting[k][i], 0));
    return new ExactTable(this.grids.refracting, floats);
  }
}

// One albedo. profile in 1/mfp^2, x in mfp.
class ExactCurve {
  constructor(table, alpha) {
    this.table = table;
    this.reflectance = table.reflectance(alpha);
    this.kappa = decayRate(alpha);
    const place = table.rowOf(Math.sqrt(Math.max(1 - alpha, 0)));
    const row = (numbers) => Float64Array.from({ length: table.columns }, (_, column) =>
      table.between(numbers, place, table.columns, column));
    this.logProfile = row(table.profile);
    this.logCdf = row(table.cdf);
  }

  at(row, x) {
    const { low, high, columns } = this.table;
    return this.table.between(row, Math.log(x / low) / Math.log(high / low) * (columns - 1), 1, 0, columns);
  }

  // Closer to the source than the table R_d goes as 1/x.
  profile(x) {
    const { low, high } = this.table;
    const near = Math.min(Math.max(x, low), high);
    return this.reflectance * Math.exp(this.at(this.logProfile, near) - this.kappa * Math.max(x, low)) * near / Math.min(x, near);
  }

  cdf(x) {
    const { low, high } = this.table;
    const near = Math.min(Math.max(x, low), high);
    return Math.min(Math.exp(this.at(this.logCdf, near)) * Math.min(x, high), 1);
  }

  // The radius within which the share leaves [mfp], by halvings of ln x.
  quantile(share) {
    let low = Math.log(this.table.low), high = Math.log(this.table.high);
    for (let i = 0; i < 50; ++i) {
      const middle = 0.5 * (low + high);
      if (this.cdf(Math.exp(middle)) < share) low = middle; else high = middle;
    }
    return Math.exp(low);
  }

  // Share of its light that a point at x [mfp] of a plane lit for x > 0 gathers: what edge.frag does.
  edge(x) {
    const step = 0.25, steps = 72, d = Math.abs(x);
    let dark = 0.5 * (1 - this.cdf(d));
    for (let i = 1; i <= steps; ++i) {
      const wide = Math.cosh(step * i);
      dark += (1 - this.cdf(d * wide)) / wide;
    }
    dark *= step / Math.PI;
    return x > 0 ? 1 - dark : dark;
  }
}
