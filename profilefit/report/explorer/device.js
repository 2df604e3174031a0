// WebGL2: programs whose errors can be read, and passes whose results come back as the bits of floats. Integer targets
// are in WebGL2 itself: no extension is needed.
const WIDTH = 1024; // of the textures of arguments
const CORNERS = `#version 300 es
void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    gl_Position = vec4(corner, 0.0, 1.0);
}
`;

// A shader that does not compile: which, the line, and what the driver says.
class ShaderFault extends Error {
  constructor(name, source, log) {
    const told = (log || "the driver does not say why").trim().split("\n")[0].replace(/\0/g, "");
    const number = Number((told.match(/\b0:(\d+)/) || [])[1] || 0);
    const line = source.split("\n")[number - 1];
    super(`${name} does not compile${line === undefined ? "" : `, line ${number}, \`${line.trim()}\``}: ${told}`);
  }
}

class Device {
  constructor(canvas) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", { antialias: false, preserveDrawingBuffer: true });
    if (!this.gl) throw new Error("This browser gives no WebGL2");
    this.gl.bindVertexArray(this.gl.createVertexArray());
  }

  program(name, fragment) {
    const { gl } = this;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, CORNERS], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost()) {
        throw new ShaderFault(name, source, gl.getShaderInfoLog(shader));
      }
      gl.deleteShader(shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new ShaderFault(name, fragment, gl.getProgramInfoLog(program));
    }
    return program;
  }

  texture(format, width, height, data = null) {
    const { gl } = this;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    const [inside, order, type] = format === "float" ? [gl.RGBA32F, gl.RGBA, gl.FLOAT]
      : [gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT];
    gl.texImage2D(gl.TEXTURE_2D, 0, inside, width, height, 0, order, type, data);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    return texture;
  }

  // Textures to draw into at once.
  target(textures) {
    const { gl } = this;
    const frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    textures.forEach((texture, i) =>
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, texture, 0));
    gl.drawBuffers(textures.map((_, i) => gl.COLOR_ATTACHMENT0 + i));
    return frame;
  }

  // Draw into a frame, null for the canvas. A number is an int uniform if `whole` names it.
  draw(program, frame, [width, height], textures, values, whole = []) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.viewport(0, 0, width, height);
    gl.useProgram(program);
    Object.entries(textures).forEach(([name, texture], unit) => {
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.uniform1i(gl.getUniformLocation(program, name), unit);
    });
    for (const [name, value] of Object.entries(values)) {
      const place = gl.getUniformLocation(program, name);
      if (Array.isArray(value)) gl.uniform3fv(place, value);
      else if (whole.includes(name)) gl.uniform1i(place, value);
      else gl.uniform1f(place, value);
    }
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  // Floats of an integer frame's first attachment, four a pixel.
  read(frame, [width, height]) {
    const { gl } = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    gl.readBuffer(gl.COLOR_ATTACHMENT0);
    const bits = new Uint32Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA_INTEGER, gl.UNSIGNED_INT, bits);
    return new Float32Array(bits.buffer);
  }

  // A program at many arguments (x, alpha, mfp), one a pixel: its results, four each.
  evaluate(program, rows) {
    const { gl } = this;
    const size = [WIDTH, Math.max(Math.ceil(rows.length / WIDTH), 1)];
    const given = new Float32Array(4 * size[0] * size[1]);
    rows.forEach((row, i) => given.set(row, 4 * i));
    const from = this.texture("float", ...size, given), into = this.texture("bits", ...size);
    const frame = this.target([into]);
    this.draw(program, frame, size, { arguments: from }, {});
    const found = this.read(frame, size);
    gl.deleteFramebuffer(frame);
    gl.deleteTexture(from);
    gl.deleteTexture(into);
    return found;
  }

  release(...programs) {
    programs.forEach((program) => this.gl.deleteProgram(program));
  }
}
