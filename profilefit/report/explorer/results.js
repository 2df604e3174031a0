// What was measured, drawn and in numbers.
const CHANNELS = ["red", "green", "blue"];
const VIEWS = {
  rr: { title: "r R_d(r) [1/mm]", of: (value, r) => value * r },
  rd: { title: "R_d(r) [1/mm²]", of: (value) => value },
  error: { title: "Relative error of R_d" },
};

function significant(value, digits = 2) {
  if (!Number.isFinite(value)) return "–"; // where there is no light
  if (value === 0) return "0";
  return value < 1e-3 ? value.toExponential(digits - 1).replace("e-", "e−") : value.toPrecision(digits);
}

class Results {
  constructor(root) {
    this.part = (name) => root.querySelector(`[data-part="${name}"]`);
  }

  draw(measured, view) {
    this.profiles(measured.channels, view);
    this.shares(measured.channels);
    this.edge(measured);
    this.table(measured.channels);
  }

  // What is said of a law under an index that it was not made for.
  foreign(law, n) {
    this.part("foreign").hidden = law.follows(n);
    this.part("foreign").textContent = `${law.label} is of n = 1 and ignores the refracting surface of n = ${n}. `
      + "It is drawn at the alpha of the exact solution. Compare it with hazard, which follows n.";
  }

  profiles(channels, view) {
    const { title, of } = VIEWS[view];
    this.part("profile-title").innerHTML = subscripts(title);
    const lines = view === "error" ? errors(channels) : pairs(channels, "profile", "exactProfile", of);
    plot(this.part("profile"), { x: radii(channels), y: { label: title, ...heights(lines, view) }, lines });
  }

  shares(channels) {
    const y = { low: 0, high: 1, label: "cdf" };
    plot(this.part("cdf"), { x: radii(channels), y, lines: pairs(channels, "cdf", "exactCdf", (value) => value) });
  }

  edge({ channels, x, reach }) {
    const colours = (key) => Array.from(x, (_, i) => channels.map((one) => one.reflectance * one[key][i]));
    const law = colours("edge"), exact = colours("exactEdge");
    strip(this.part("edge-law"), law);
    strip(this.part("edge-exact"), exact);
    strip(this.part("edge-difference"), law.map((row, i) => row.map((value, c) => GREY + 10 * (value - exact[i][c]))));
    const lines = pairs(channels.map((one) => ({ ...one, r: x })), "edge", "exactEdge", (v, _, one) => v * one.reflectance);
    const high = Math.max(...channels.map((one) => one.reflectance), 0.05) * 1.05;
    plot(this.part("edge"), {
      x: { low: -reach, high: reach, label: "distance from the edge of the light [mm]" },
      y: { low: 0, high, label: "radiance over that of a lit white surface" }, lines, height: 190,
    });
  }

  table(channels) {
    this.part("readout").innerHTML = channels.map((one, c) => `<tr data-channel="${CHANNELS[c]}"
 data-rel="${one.rel}" data-ks="${one.ks}"><th scope="row"><i class="${CHANNELS[c]}"></i>${CHANNELS[c]}</th>
<td>${one.reflectance.toFixed(3)}</td><td>${alphaText(one.alpha)}</td><td>${one.mfp.toPrecision(3)}</td>
<td>${significant(one.rel)}</td><td>${significant(one.ks)}</td><td>${significant(one.edgeError)}</td></tr>`).join("");
  }
}

const GREY = 0.214; // linear: the middle of a screen's values

function alphaText(alpha) {
  return alpha.toFixed(alpha > 0.99 ? 5 : 3);
}

function subscripts(text) {
  return text.replace(/_(\w)/g, "<sub>$1</sub>");
}

function radii(channels) {
  const { r } = channels[0];
  return { log: true, low: r[0], high: r[r.length - 1], label: "r [mm]" };
}

// A line for the law and one for the exact half space of each channel, the exact ones on top.
function pairs(channels, law, exact, of) {
  const line = (key, kind) => (one, c) =>
    ({ x: one.r, y: one[key].map((value, i) => of(value, one.r[i], one)), kind: `${kind} ${CHANNELS[c]}` });
  return [...channels.map(line(law, "law")), ...channels.map(line(exact, "exact"))];
}

function errors(channels) {
  return channels.map((one, c) => {
    const inside = (r) => r >= NEAREST * one.mfp && r <= one.outer * one.mfp;
    const y = one.profile.map((value, i) => (inside(one.r[i]) ? value / one.exactProfile[i] - 1 : NaN));
    return { x: one.r, y, kind: `law ${CHANNELS[c]}` };
  });
}

// The range of the vertical axis: a law that is far off may leave it.
function heights(lines, view) {
  const largest = (some) => Math.max(...some.map((line) => line.y.reduce((most, v) => (v > most ? v : most), 0)));
  if (view === "error") {
    const worst = largest(lines.map((line) => ({ y: line.y.map(Math.abs) })));
    const end = Math.min(round125(Math.max(worst, 1e-6)), 1);
    return { low: -end, high: end, percent: true };
  }
  const exact = largest(lines.filter((line) => line.kind.startsWith("exact")));
  if (view === "rd") return { log: true, low: Math.max(exact, 1e-30) * 1e-8, high: Math.max(exact, 1e-30) * 2 };
  return { low: 0, high: Math.max(Math.min(largest(lines), 3 * exact) * 1.08, 1e-12) };
}
