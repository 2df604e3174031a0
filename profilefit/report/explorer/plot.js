// A chart as SVG: its colours come from the page, its size in pixels is that of its place.
const MARGIN = { left: 46, right: 10, top: 8, bottom: 34 };
const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";

// axis: { log, low, high, label, percent }
function scaled(axis, value) {
  return axis.log ? Math.log(value / axis.low) / Math.log(axis.high / axis.low)
    : (value - axis.low) / (axis.high - axis.low);
}

// At most so many: whole powers of ten, or steps of 1, 2 or 5.
function ticks(axis, most) {
  if (!axis.log) {
    const step = round125((axis.high - axis.low) / most);
    const first = Math.ceil(axis.low / step - 1e-6), last = Math.floor(axis.high / step + 1e-6);
    return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
  }
  const first = Math.ceil(Math.log10(axis.low) - 1e-9), last = Math.floor(Math.log10(axis.high) + 1e-9);
  const stride = Math.ceil((last - first + 1) / most);
  return Array.from({ length: Math.floor((last - first) / stride) + 1 }, (_, i) => 10 ** (first + stride * i));
}

function tickText(axis, value) {
  if (axis.percent) return `${Number((100 * value).toPrecision(2))} %`.replace("-", "−");
  const power = Math.round(Math.log10(Math.abs(value)));
  if (axis.log && Math.abs(power) > 2) {
    return "10" + (power < 0 ? "⁻" : "") + [...String(Math.abs(power))].map((digit) => SUPERSCRIPTS[digit]).join("");
  }
  return String(Number(value.toPrecision(3))).replace("-", "−");
}

function path({ x, y }) {
  let d = "", pen = "M";
  for (let i = 0; i < x.length; ++i) {
    if (!Number.isFinite(y[i])) { pen = "M"; continue; }
    d += `${pen}${x[i].toFixed(1)} ${Math.min(Math.max(y[i], -1e4), 1e4).toFixed(1)}`;
    pen = "L";
  }
  return d;
}

// lines: { x, y, kind } of which kind is the class of the line.
function plot(place, { x, y, lines, height = 236 }) {
  const width = Math.max(place.clientWidth, 200);
  const inner = { width: width - MARGIN.left - MARGIN.right, height: height - MARGIN.top - MARGIN.bottom };
  const across = (value) => inner.width * scaled(x, value), up = (value) => inner.height * (1 - scaled(y, value));
  const grid = [], texts = [];
  for (const value of ticks(x, Math.max(inner.width / 60, 2))) {
    const at = across(value).toFixed(1);
    grid.push(`M${at} 0V${inner.height}`);
    texts.push(`<text x="${at}" y="${inner.height + 14}" text-anchor="middle">${tickText(x, value)}</text>`);
  }
  for (const value of ticks(y, 5)) {
    const at = up(value).toFixed(1);
    grid.push(`M0 ${at}H${inner.width}`);
    texts.push(`<text x="-6" y="${at}" dy=".35em" text-anchor="end">${tickText(y, value)}</text>`);
  }
  texts.push(`<text class="axis" x="${inner.width / 2}" y="${inner.height + 29}" text-anchor="middle">${x.label}</text>`);
  const curves = lines.map((line) => ({ kind: line.kind, x: Array.from(line.x, across), y: Array.from(line.y, up) }));
  const drawn = curves.map((curve) => `<path class="${curve.kind}" d="${path(curve)}"/>`).join("");
  place.innerHTML = `<svg width="${width}" height="${height}" role="img" aria-label="${y.label} over ${x.label}">
<g transform="translate(${MARGIN.left} ${MARGIN.top})"><path class="grid" d="${grid.join("")}"/>
<svg width="${inner.width}" height="${inner.height}" overflow="hidden">${drawn}${letters(curves, inner.width, inner.height)}</svg>${texts.join("")}</g></svg>`;
}

// A row of pixels over the plot of the same x: colours is a list of [red, green, blue], linear, white 1.
function strip(canvas, colours) {
  canvas.width = colours.length;
  canvas.height = 1;
  const image = new ImageData(colours.length, 1);
  colours.forEach((colour, i) => image.data.set([...colour.map(srgb), 255], 4 * i));
  canvas.getContext("2d").putImageData(image, 0, 0);
}

// The 8-bit value of a screen (IEC 61966-2-1).
function srgb(linear) {
  const clipped = Math.min(Math.max(linear, 0), 1);
  return Math.round(255 * (clipped <= 0.0031308 ? 12.92 * clipped : 1.055 * clipped ** (1 / 2.4) - 0.055));
}
