// A letter on each curve, R, G or B, so that curves differ not by colour alone: where it is farthest from the
// curves of the other channels. An exact curve has one of its own only where it leaves its law's.
const CLEAR = 24, APART = 16, LEAVES = 10; // [pixels]: far enough; between letters; from its law's curve
const TRIED = 4; // one point of so many

// curves: { kind, x, y } in pixels, all at the same x. Those of the laws come first.
function letters(curves, width, height) {
  const placed = [];
  for (const curve of curves) {
    const [law, channel] = curve.kind.split(" ");
    const others = curves.filter((one) => one !== curve && (law === "exact" || !one.kind.endsWith(channel)));
    const best = clearest(curve, others, placed, width, height);
    if (best && (law === "law" || best.clear >= LEAVES)) placed.push({ ...best, kind: curve.kind, letter: channel[0].toUpperCase() });
  }
  return placed.map(({ x, y, kind, letter }) =>
    `<text class="letter ${kind}" x="${x.toFixed(1)}" y="${y.toFixed(1)}" dy=".35em" text-anchor="middle">${letter}</text>`).join("");
}

// The point inside the frame, away from letters that stand there: of equals the one nearest to the middle.
function clearest({ x, y }, others, placed, width, height) {
  let best = null;
  for (let i = 0; i < x.length; i += TRIED) {
    const inside = x[i] > 8 && x[i] < width - 8 && y[i] > 8 && y[i] < height - 8;
    if (!inside || placed.some((one) => Math.hypot(one.x - x[i], one.y - y[i]) < APART)) continue;
    const clear = Math.min(CLEAR, ...others.map((one) => distance(x[i], y[i], one)));
    const rank = clear - Math.abs(x[i] / width - 0.5);
    if (!best || rank > best.rank) best = { x: x[i], y: y[i], clear, rank };
  }
  return best;
}

function distance(x, y, curve) {
  let least = Infinity;
  for (let i = 0; i < curve.x.length; ++i) {
    const square = (curve.x[i] - x) ** 2 + (curve.y[i] - y) ** 2;
    if (square < least) least = square;
  }
  return Math.sqrt(least);
}
