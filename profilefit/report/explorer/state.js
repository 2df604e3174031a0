// What is chosen, and the same in the address of the page, so that it can be sent.
const HASH = "#explorer?";
const SAMPLES = [1, 4, 16, 64, 256, 1024]; // a pixel of the ball

class State {
  constructor({ laws, materials, tables, indices, start }) {
    Object.assign(this, { laws, materials, tables, indices: [1, ...indices] });
    this.start = laws.find((law) => law.id === start) || laws[0];
    this.begin();
    this.read();
  }

  begin() {
    Object.assign(this, { samples: 64, radius: 10, even: 0.05, view: "rr", turn: [-40, 35], law: this.start, n: 1 });
    this.take(this.materials.find((one) => one.name === "skin1") || this.materials[0]);
  }

  get table() {
    return this.tables[this.law.light].at(this.n);
  }

  // alpha and l of a measured material; A under this light and surface.
  take(material) {
    this.material = material;
    this.mfp = [...material.mfp];
    this.reflectance = material.alpha.map((alpha) => this.table.reflectance(alpha));
  }

  // A law under the other light: of the same name, or the first; a material keeps its alpha.
  under(light) {
    const there = this.laws.filter((law) => law.light === light);
    this.choose(there.find((law) => law.name === this.law.name) || there[0]);
  }

  choose(law) {
    this.law = law;
    if (this.material) this.take(this.material);
  }

  // The nearest index that the page knows.
  refract(n) {
    const off = (one) => Math.abs(one - n);
    this.n = this.indices.reduce((best, one) => (off(one) < off(best) ? one : best));
    if (this.material) this.take(this.material);
  }

  set(key, channel, value) {
    this[key][channel] = value;
    this.material = null;
  }

  // Unit vector towards the light: x right, y up, z to the viewer.
  get towardLight() {
    const [around, up] = this.turn.map((degrees) => degrees * Math.PI / 180);
    return [Math.cos(up) * Math.sin(around), Math.sin(up), Math.cos(up) * Math.cos(around)];
  }

  turnTo([x, y, z]) {
    this.turn = [Math.atan2(x, z), Math.asin(Math.min(Math.max(y, -1), 1))].map((angle) => Math.round(angle * 180 / Math.PI));
  }

  write() {
    const told = { law: this.law.id };
    if (this.material) told.material = this.material.name;
    else Object.assign(told, { A: this.reflectance.map(short).join(), l: this.mfp.map(short).join() });
    const { samples, n, radius, even, view, turn } = this;
    Object.assign(told, { samples, n, radius, even, view, turn: turn.join() });
    history.replaceState(null, "", HASH + Object.entries(told).map(([key, value]) => `${key}=${value}`).join("&"));
  }

  // What the address says, as far as it can be meant; whether it speaks of the explorer.
  read() {
    if (!location.hash.startsWith(HASH)) return false;
    this.begin(); // what it leaves out is as at the start
    const told = new URLSearchParams(location.hash.slice(HASH.length));
    this.several(told.get("n"), 1, this.indices[this.indices.length - 1], ([n]) => this.refract(n), 1);
    this.choose(this.laws.find((law) => law.id === told.get("law")) || this.law);
    const material = this.materials.find((one) => one.name === told.get("material"));
    if (material) this.take(material);
    this.several(told.get("A"), 0, 1, (A) => { this.reflectance = A; this.material = null; });
    this.several(told.get("l"), 1e-3, 1e3, (l) => { this.mfp = l; this.material = null; });
    this.several(told.get("turn"), -180, 180, (turn) => { this.turn = turn; }, 2);
    if (SAMPLES.includes(Number(told.get("samples")))) this.samples = Number(told.get("samples"));
    this.several(told.get("radius"), 0.1, 1000, ([radius]) => { this.radius = radius; }, 1);
    this.several(told.get("even"), 0, 1, ([even]) => { this.even = even; }, 1);
    if (Object.hasOwn(VIEWS, told.get("view"))) this.view = told.get("view");
    return true;
  }

  several(text, low, high, take, count = 3) {
    const numbers = (text || "").split(",").map((one) => (one.trim() ? Number(one) : NaN));
    if (numbers.length === count && numbers.every((one) => one >= low && one <= high)) take(numbers);
  }
}

function short(value) {
  return Number(value.toPrecision(6));
}
