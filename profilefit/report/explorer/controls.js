// Inputs that show the state and change it.
class Controls {
  constructor(root, state, changed) {
    Object.assign(this, { root, state, changed });
    this.input = (name) => root.querySelector(`#explorer-${name}`);
    this.fill(this.input("material"), [["", "own"], ...state.materials.map((one) => [one.name, one.name])]);
    this.fill(this.input("samples"), SAMPLES.map((count) => [count, `${count} a pixel`]));
    this.choices();
    this.sliders();
    this.show();
  }

  fill(select, options) {
    select.replaceChildren(...options.map(([value, text]) => new Option(text, value)));
  }

  choices() {
    const { state } = this;
    this.on(this.input("law"), (value) => state.choose(state.laws.find((law) => law.id === value)));
    this.on(this.input("material"), (value) => {
      const material = state.materials.find((one) => one.name === value);
      if (material) state.take(material); else state.material = null;
    });
    this.on(this.input("samples"), (value) => { state.samples = Number(value); });
    for (const one of this.radios("kind")) this.on(one, (value) => state.under(value));
    for (const one of this.radios("view")) this.on(one, (value) => { state.view = value; });
  }

  radios(name) {
    return this.root.querySelectorAll(`[name="explorer-${name}"]`);
  }

  sliders() {
    const { state } = this;
    CHANNELS.forEach((channel, c) => {
      this.on(this.input(`A-${channel}`), (value) => state.set("reflectance", c, Number(value)));
      this.on(this.input(`l-${channel}`), (value) => state.set("mfp", c, short(10 ** Number(value))));
    });
    this.on(this.input("n"), (value) => state.refract(Number(value)));
    this.on(this.input("radius"), (value) => { state.radius = short(Number((10 ** Number(value)).toPrecision(2))); });
    this.on(this.input("even"), (value) => { state.even = Number(value); });
  }

  on(input, take) {
    input.addEventListener("input", () => {
      take(input.value);
      this.show();
      this.changed();
    });
  }

  // The state in the inputs; a slider shows the nearest that it can.
  show() {
    const { state } = this;
    const there = state.laws.filter((law) => law.light === state.law.light);
    this.fill(this.input("law"), there.map((law) => [law.id, law.labelAt(state.n)]));
    this.input("law").value = state.law.id;
    this.input("material").value = state.material ? state.material.name : "";
    this.input("samples").value = String(state.samples);
    for (const one of this.radios("kind")) one.checked = one.value === state.law.light;
    for (const one of this.radios("view")) one.checked = one.value === state.view;
    CHANNELS.forEach((channel, c) => {
      this.slide(`A-${channel}`, state.reflectance[c], state.reflectance[c].toFixed(3));
      this.slide(`l-${channel}`, Math.log10(state.mfp[c]), state.mfp[c].toPrecision(3));
    });
    this.slide("n", state.n, state.n.toFixed(2));
    this.slide("radius", Math.log10(state.radius), `${state.radius} mm`);
    this.slide("even", state.even, `${Math.round(100 * state.even)} %`);
  }

  slide(name, value, told) {
    const input = this.input(name);
    if (input !== document.activeElement || Math.abs(input.value - value) > Number(input.step)) input.value = value;
    const share = (input.value - input.min) / (input.max - input.min);
    input.style.setProperty("--x-filled", `${100 * Math.min(Math.max(share, 0), 1)}%`);
    input.setAttribute("aria-valuetext", told);
    input.nextElementSibling.textContent = told;
  }
}

// The light of the balls follows a pointer, or the arrow keys.
function turnable(canvas, state, changed) {
  const follow = (event) => {
    const box = canvas.getBoundingClientRect(), side = box.width / 2;
    const within = (event.clientX - box.left) % side;
    const x = (2 * within - side) / (0.94 * side), y = (box.height - 2 * (event.clientY - box.top)) / (0.94 * side);
    const length = Math.hypot(x, y), inside = Math.max(length, 1);
    state.turnTo([x / inside, y / inside, Math.sqrt(Math.max(1 - length * length, 0))]);
    changed();
  };
  canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); follow(event); });
  canvas.addEventListener("pointermove", (event) => { if (canvas.hasPointerCapture(event.pointerId)) follow(event); });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: [-5, 0], ArrowRight: [5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }[event.key];
    if (!step) return;
    event.preventDefault();
    const [around, up] = [state.turn[0] + step[0], state.turn[1] + step[1]];
    state.turn = [(around + 540) % 360 - 180, Math.min(Math.max(up, -90), 90)];
    changed();
  });
}
