// Two lit balls, Lambert's and the law's: samples are added from frame to frame until there are enough.
const FRAMES = 32; // at most, for all samples
const PRINTED = 64; // samples that printing waits for

class Ball {
  constructor(device) {
    this.device = device;
    this.seen = false;
    this.still = matchMedia("(prefers-reduced-motion: reduce)");
    new IntersectionObserver((found) => {
      this.seen = found[found.length - 1].isIntersecting;
      this.go();
    }, { rootMargin: "100%" }).observe(device.canvas); // drawn before it is scrolled to
    this.resize();
  }

  resize() {
    const { canvas } = this.device;
    const side = Math.max(Math.round(canvas.clientWidth * Math.min(devicePixelRatio, 1.5) / 2), 16);
    if (side === this.side) return;
    this.side = side;
    canvas.width = 2 * side;
    canvas.height = side;
    this.free();
    this.sums = [0, 1].map(() => {
      const textures = [this.device.texture("bits", side, side), this.device.texture("bits", side, side)];
      return { textures, frame: this.device.target(textures) };
    });
    this.restart();
  }

  free() {
    const { gl } = this.device;
    for (const { textures, frame } of this.sums || []) {
      gl.deleteFramebuffer(frame);
      textures.forEach((texture) => gl.deleteTexture(texture));
    }
  }

  // Begin again: with other programs (ball.frag, show.frag), or another scene.
  restart(programs = this.programs, scene = this.scene) {
    Object.assign(this, { programs, scene, done: 0 });
    if (!programs) return;
    const { gl } = this.device;
    this.inside = this.shares();
    for (const { frame } of this.sums) {
      gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
      [0, 1].forEach((i) => gl.clearBufferuiv(gl.COLOR, i, [0, 0, 0, 0]));
    }
    this.go();
  }

  // Of xi, that draw chords within the ball: for each channel.
  shares() {
    const { alpha, mfp, radius } = this.scene;
    const found = this.device.evaluate(this.programs.inside, alpha.map((one, c) => [2 * radius / mfp[c], one, 1]));
    return [0, 1, 2].map((c) => found[4 * c]);
  }

  stop() {
    this.programs = null;
  }

  go() {
    if (this.waiting || !this.seen || !this.programs || this.done >= this.scene.samples) return;
    this.waiting = requestAnimationFrame(() => {
      this.waiting = 0;
      if (!this.programs || this.device.gl.isContextLost()) return;
      this.step();
      if (!this.still.matches || this.done >= this.scene.samples) this.show();
      this.go();
    });
  }

  // For paper, which nobody scrolls: now, though not in sight.
  finish() {
    if (!this.programs || this.device.gl.isContextLost()) return;
    while (this.done < Math.min(this.scene.samples, PRINTED)) this.step();
    this.show();
  }

  step() {
    const { scene, side } = this;
    const count = Math.min(Math.ceil(scene.samples / FRAMES), scene.samples - this.done);
    const [before, after] = this.sums;
    const { alpha, mfp, radius, towardLight, even } = scene;
    const values = { alpha, mfp, radius, inside: this.inside, toward_light: towardLight, even, first: this.done, count, seed: 1 };
    this.device.draw(this.programs.ball, after.frame, [side, side], named(before), { ...values, side }, ["first", "count", "seed"]);
    this.sums.reverse();
    this.done += count;
  }

  show() {
    const { side } = this, { reflectance, towardLight, even } = this.scene;
    const values = { reflectance, toward_light: towardLight, even, side };
    this.device.draw(this.programs.show, null, [2 * side, side], named(this.sums[0]), values);
  }

  // Sums of the light over A and of the weights, each row by row from below: red, green, blue, 0.
  told() {
    const { device, side, sums: [{ textures }] } = this;
    return textures.map((texture) => {
      const frame = device.target([texture]);
      const floats = device.read(frame, [side, side]);
      device.gl.deleteFramebuffer(frame);
      return floats;
    });
  }
}

function named({ textures: [light, weight] }) {
  return { light_before: light, weight_before: weight };
}
