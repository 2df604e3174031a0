// The parts together. Without WebGL2, or when its context is lost, the static picture stays.
const PROGRAMS = ["values", "edge", "inside", "ball", "show"];

class Explorer {
  constructor(root) {
    this.root = root;
    const data = JSON.parse(root.querySelector("[data-part='data']").textContent);
    this.shaders = data.shaders;
    const tables = Object.fromEntries(Object.entries(data.tables).map(([light, floats]) =>
      [light, new ExactTables(data, floats)]));
    const laws = data.laws.map((law) => new Law(law, data.lines, data.indices));
    this.state = new State({ ...data, laws, tables });
    this.canvas = root.querySelector("[data-part='ball']");
    this.results = new Results(root);
    this.canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.stand("The graphics context was lost: this picture stands in until it comes back.");
    });
    this.canvas.addEventListener("webglcontextrestored", () => this.start());
    addEventListener("hashchange", () => { if (this.state.read()) this.moved(); });
    addEventListener("beforeprint", () => { if (this.ball) this.ball.finish(); });
    this.start();
  }

  start() {
    try {
      this.device = new Device(this.canvas);
    } catch (fault) {
      this.stand(`${fault.message}: this picture stands in for the explorer.`);
      return;
    }
    this.root.dataset.state = "live";
    this.programs = this.ball = null;
    this.measuredFor = "";
    if (!this.controls) {
      this.controls = new Controls(this.root, this.state, () => this.later(true));
      turnable(this.canvas, this.state, () => this.later(true));
      new ResizeObserver(() => this.later(false)).observe(this.root);
      if (location.hash.startsWith(HASH)) this.root.scrollIntoView();
    }
    this.update();
  }

  // To what an address says that came after the page was open.
  moved() {
    this.root.scrollIntoView();
    if (!this.controls) return;
    this.controls.show();
    this.later(false);
  }

  stand(why) {
    this.root.dataset.state = "still";
    this.root.querySelector("[data-part='why']").textContent = why;
    if (this.ball) this.ball.stop();
  }

  // Once before the next frame, however much has changed.
  later(chosen) {
    this.chosen = this.chosen || chosen;
    if (this.waiting || this.root.dataset.state !== "live") return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      if (this.chosen) this.state.write();
      this.chosen = false;
      this.update();
    });
  }

  update() {
    const fault = this.root.querySelector("[data-part='fault']");
    try {
      this.compile();
      fault.hidden = true;
    } catch (error) {
      if (!(error instanceof ShaderFault)) throw error;
      fault.textContent = error.message;
      fault.hidden = false;
    }
    this.root.classList.toggle("faulty", !fault.hidden);
    if (fault.hidden) this.show();
  }

  // Only the law that is chosen, at its index.
  compile() {
    const { device, shaders, state: { law, n } } = this, text = law.textAt(n);
    if (this.programs && this.programs.text === text) return;
    if (this.ball) this.ball.stop();
    if (this.programs) device.release(...PROGRAMS.map((name) => this.programs[name]));
    this.programs = null;
    const head = "#version 300 es\n", floats = "precision highp float;\n";
    const by = (part) => device.program(`${law.label}: ${part}`, `${head}${text}\n${shaders[part]}`);
    this.programs = {
      text, values: by("values"), edge: by("edge"), inside: by("inside"), ball: by("ball"),
      show: device.program("balls", head + floats + shaders.show),
    };
    this.root.querySelector("[data-part='text']").textContent = text;
  }

  show() {
    const { state, device, programs } = this, { law, n, reflectance, mfp } = state;
    const asked = [law.id, n, ...reflectance, ...mfp].join();
    if (asked !== this.measuredFor) {
      this.measured = new Measurement(device, programs, state.table, state);
      this.measuredFor = asked;
    }
    this.results.draw(this.measured, state.view);
    this.results.foreign(law, n);
    this.values = { law: law.id, ...this.measured };
    this.light();
  }

  light() {
    const { samples, radius, even, towardLight, mfp } = this.state;
    const [alpha, reflectance] = ["alpha", "reflectance"].map((key) => this.measured.channels.map((one) => one[key]));
    const scene = { alpha, mfp: [...mfp], reflectance, radius, even, towardLight, samples };
    if (!this.ball) this.ball = new Ball(this.device);
    this.ball.resize();
    const told = JSON.stringify([this.programs.text, scene]);
    if (told !== this.lit || this.ball.programs !== this.programs) this.ball.restart(this.programs, scene);
    this.lit = told;
  }
}

document.querySelectorAll(".explorer").forEach((root) => { window.explorer = new Explorer(root); });
