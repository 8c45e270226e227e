// Three linked views of a clip on plain WebGL.

const VERTEX_SHADER = `
attribute vec3 position; attribute vec3 normal; attribute float value;
uniform mat4 view; uniform mat4 projection;
varying vec3 eyeNormal; varying float shade; varying vec3 eye;
void main() {
  vec4 p = view * vec4(position, 1.0);
  eye = p.xyz; eyeNormal = mat3(view[0].xyz, view[1].xyz, view[2].xyz) * normal; shade = value;
  gl_Position = projection * p;
}`;
const FRAGMENT_SHADER = `
precision highp float;
varying vec3 eyeNormal; varying float shade; varying vec3 eye;
uniform vec3 ramp[5]; uniform float flat_colour; uniform vec3 line_colour;
void main() {
  if (flat_colour > 0.5) { gl_FragColor = vec4(line_colour, 1.0); return; }
  float x = clamp(shade, 0.0, 1.0) * 4.0;
  vec3 c = mix(ramp[0], ramp[1], clamp(x, 0.0, 1.0));
  c = mix(c, ramp[2], clamp(x - 1.0, 0.0, 1.0));
  c = mix(c, ramp[3], clamp(x - 2.0, 0.0, 1.0));
  c = mix(c, ramp[4], clamp(x - 3.0, 0.0, 1.0));
  vec3 n = normalize(eyeNormal);
  float key = max(dot(n, normalize(vec3(0.45, 0.7, 0.65))), 0.0);
  float fill = max(dot(n, normalize(vec3(-0.7, 0.15, 0.5))), 0.0);
  float rim = pow(1.0 - max(dot(n, normalize(-eye)), 0.0), 3.0);
  vec3 lit = c * (0.40 + 0.13 * n.y + 0.58 * key + 0.18 * fill) + vec3(0.10) * rim;
  gl_FragColor = vec4(pow(lit, vec3(0.94)), 1.0);
}`;

// Low to high, 0..1 a channel.
const RAMPS = {
  error: [[0.84, 0.80, 0.77], [0.98, 0.84, 0.42], [0.95, 0.52, 0.27], [0.80, 0.20, 0.24], [0.42, 0.05, 0.24]],
  displacement: [[0.84, 0.80, 0.77], [0.60, 0.84, 0.80], [0.22, 0.66, 0.72], [0.12, 0.42, 0.62], [0.12, 0.18, 0.42]],
  plain: Array(5).fill([0.84, 0.80, 0.77]),
};

async function inflate(base64) {
  const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The inverse of pack.rs: zigzagged second differences, low bytes then high bytes, [T, 3, V].
async function unpack(packed, frames, vertices) {
  const bytes = await inflate(packed.data);
  const count = frames * vertices * 3;
  const stride = vertices * 3;
  const q = new Int16Array(count);
  for (let i = 0; i < count; i++) {
    const z = bytes[i] | (bytes[count + i] << 8);
    const r = (z >>> 1) ^ -(z & 1);
    q[i] = i < stride ? r : i < 2 * stride ? r + q[i - stride] : r + 2 * q[i - stride] - q[i - 2 * stride];
  }
  return { q, step: packed.step, centre: packed.centre };
}

// Column-major, as WebGL takes them.
function perspective(fieldOfView, aspect, near, far) {
  const f = 1 / Math.tan(fieldOfView / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
}

function orbit(target, distance, yaw, pitch) {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  // rows of the rotation: right, up, back
  const right = [cy, 0, -sy], up = [-sy * sp, cp, -cy * sp], back = [sy * cp, sp, cy * cp];
  const dot = (a) => a[0] * target[0] + a[1] * target[1] + a[2] * target[2];
  return [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right), -dot(up), -dot(back) - distance, 1];
}

class View {
  constructor(canvas, faces, vertices) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl", { antialias: true, alpha: true, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser gives no WebGL");
    this.gl = gl;
    const wide = vertices > 65535;
    if (wide && !gl.getExtension("OES_element_index_uint")) throw new Error("this browser's WebGL cannot index so large a mesh");
    this.indexType = wide ? gl.UNSIGNED_INT : gl.UNSIGNED_SHORT;
    const program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, VERTEX_SHADER], [gl.FRAGMENT_SHADER, FRAGMENT_SHADER]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.at = (name) => gl.getUniformLocation(program, name);
    this.attribute = (name) => gl.getAttribLocation(program, name);
    this.buffers = { position: gl.createBuffer(), normal: gl.createBuffer(), value: gl.createBuffer(), index: gl.createBuffer(), grid: gl.createBuffer() };
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers.index);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, wide ? faces : new Uint16Array(faces), gl.STATIC_DRAW);
    this.count = faces.length;
    gl.enable(gl.DEPTH_TEST);
  }
  grid(centre, floor) {
    const lines = [];
    for (let i = -6; i <= 6; i++) {
      const at = i * 0.25;
      lines.push(centre[0] + at, floor, centre[2] - 1.5, centre[0] + at, floor, centre[2] + 1.5);
      lines.push(centre[0] - 1.5, floor, centre[2] + at, centre[0] + 1.5, floor, centre[2] + at);
    }
    const gl = this.gl;
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.grid);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(lines), gl.STATIC_DRAW);
    this.gridCount = lines.length / 3;
  }
  feed(name, size, data) {
    const gl = this.gl, place = this.attribute(name);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
  }
  draw(positions, normals, values, ramp, camera, lineColour) {
    const gl = this.gl, ratio = Math.min(devicePixelRatio || 1, 2);
    const [w, h] = [Math.round(this.canvas.clientWidth * ratio), Math.round(this.canvas.clientHeight * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) { this.canvas.width = w; this.canvas.height = h; }
    gl.viewport(0, 0, w, h);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.uniformMatrix4fv(this.at("view"), false, orbit(camera.target, camera.distance, camera.yaw, camera.pitch));
    gl.uniformMatrix4fv(this.at("projection"), false, perspective(0.55, w / h, 0.1, 50));
    gl.uniform3fv(this.at("ramp"), ramp.flat());
    gl.uniform1f(this.at("flat_colour"), 1);
    gl.uniform3fv(this.at("line_colour"), lineColour);
    gl.disableVertexAttribArray(this.attribute("normal"));
    gl.disableVertexAttribArray(this.attribute("value"));
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.grid);
    gl.enableVertexAttribArray(this.attribute("position"));
    gl.vertexAttribPointer(this.attribute("position"), 3, gl.FLOAT, false, 0, 0);
    gl.drawArrays(gl.LINES, 0, this.gridCount);
    gl.uniform1f(this.at("flat_colour"), 0);
    this.feed("position", 3, positions);
    this.feed("normal", 3, normals);
    this.feed("value", 1, values);
    gl.drawElements(gl.TRIANGLES, this.count, this.indexType, 0);
  }
}

class Player {
  // `seek` is called with the frame whenever it changes, `loaded` with the clip and its error curves.
  constructor(data, seek, loaded) {
    this.data = data;
    this.seek = seek;
    this.loaded = loaded;
    this.cache = new Map();
    this.frame = 0;
    this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.gain = 1;
    this.colour = "error";
    this.by = (id) => document.getElementById(id);
  }
  async start() {
    const mesh = this.data.mesh;
    this.faces = new Uint32Array((await inflate(mesh.faces)).buffer);
    this.soft = await inflate(mesh.soft);
    this.views = ["reference", "alone", "predicted"].map((name) => new View(this.by("view-" + name), this.faces, mesh.vertices));
    this.readouts = [...document.querySelectorAll("#viewer .readout")];
    this.positions = [0, 1, 2].map(() => new Float32Array(mesh.vertices * 3));
    this.values = [0, 1, 2].map(() => new Float32Array(mesh.vertices));
    this.normals = new Float32Array(mesh.vertices * 3);
    this.bind();
    await this.load(0);
    let last = null;
    const tick = (now) => {
      if (this.playing && last !== null) this.advance((now - last) / 1000);
      last = now;
      requestAnimationFrame(tick);
    };
    requestAnimationFrame(tick);
  }
  bind() {
    const on = (id, event, act) => this.by(id).addEventListener(event, act);
    this.data.playback.forEach((p, i) => this.by("clip").add(new Option(p.clip, i)));
    on("clip", "change", (e) => this.load(+e.target.value));
    on("play", "click", () => this.setPlaying(!this.playing));
    on("time", "input", (e) => { this.setPlaying(false); this.show(+e.target.value); });
    on("colour", "change", (e) => { this.colour = e.target.value; this.legend(); this.show(this.frame); });
    on("gain", "input", (e) => { this.gain = +e.target.value; this.by("gain-value").textContent = "× " + this.gain; this.show(this.frame); });
    on("reset", "click", () => { this.resetCamera(); this.show(this.frame); });
    for (const view of this.views) this.drag(view.canvas);
    new ResizeObserver(() => this.show(this.frame)).observe(this.by("viewer"));
    this.setPlaying(this.playing);
  }
  drag(canvas) {
    canvas.addEventListener("pointerdown", (e) => canvas.setPointerCapture(e.pointerId));
    canvas.addEventListener("pointermove", (e) => {
      if (!canvas.hasPointerCapture(e.pointerId)) return;
      this.camera.yaw -= e.movementX * 0.01;
      this.camera.pitch = Math.min(1.4, Math.max(-0.5, this.camera.pitch + e.movementY * 0.01));
      this.show(this.frame);
    });
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.camera.distance = Math.min(12, Math.max(0.8, this.camera.distance * Math.exp(e.deltaY * 0.001)));
      this.show(this.frame);
    }, { passive: false });
  }
  setPlaying(playing) {
    this.playing = playing;
    this.by("play").textContent = playing ? "❚❚" : "▶";
  }
  async load(index) {
    const clip = this.data.playback[index], v = this.data.mesh.vertices;
    if (!this.cache.has(index)) {
      const parts = await Promise.all(["alone", "reference", "predicted"].map((name) => unpack(clip[name], clip.frames, v)));
      this.cache.set(index, { ...clip, alone: parts[0], reference: parts[1], predicted: parts[2] });
    }
    this.clip = this.cache.get(index);
    this.by("time").max = clip.frames - 1;
    this.by("view-method").textContent = this.data.labels[clip.method] || clip.method;
    this.measure();
    this.resetCamera();
    this.views.forEach((view) => view.grid(this.home, this.floor));
    this.legend();
    this.loaded(this.clip, this.curves);
    this.show(Math.min(this.frame, clip.frames - 1));
  }
  // Bounds, colour range and error curves of the clip.
  measure() {
    const { alone, reference, predicted, frames, fps } = this.clip, v = this.data.mesh.vertices;
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (let i = 0; i < alone.q.length; i++) {
      const axis = Math.floor(i / v) % 3, x = alone.q[i] * alone.step + alone.centre[axis];
      if (x < low[axis]) low[axis] = x;
      if (x > high[axis]) high[axis] = x;
    }
    this.home = [0, 1, 2].map((a) => (low[a] + high[a]) / 2);
    this.floor = low[1];
    this.size = high[1] - low[1];
    // a body that walks away is followed; one that stays is not, so that its sway can be seen
    this.path = [];
    for (let t = 0; t < frames; t++) {
      this.path.push([0, 2].map((axis) => {
        let sum = 0;
        for (let i = 0; i < v; i++) sum += alone.q[(t * 3 + axis) * v + i];
        return (sum / v) * alone.step + alone.centre[axis];
      }));
    }
    const reach = Math.max(...[0, 1].map((k) => Math.max(...this.path.map((p) => p[k])) - Math.min(...this.path.map((p) => p[k]))));
    this.follows = reach > 0.8;
    const sample = [];
    this.curves = { body: [], [this.clip.method]: [] };
    for (let t = 0; t < frames; t++) {
      let [sum, left, n] = [0, 0, 0];
      for (let i = 0; i < v; i++) {
        const [d, e] = [0, 1, 2].reduce(([d, e], a) => {
          const at = (t * 3 + a) * v + i, r = reference.q[at] * reference.step;
          return [d + r * r, e + (predicted.q[at] * predicted.step - r) ** 2];
        }, [0, 0]).map(Math.sqrt);
        if (!this.soft[i]) continue;
        sum += d; left += e; n++;
        if ((t + i) % 7 === 0) sample.push(d);
      }
      this.curves.body.push([t / fps, (sum / n) * 1000]);
      this.curves[this.clip.method].push([t / fps, (left / n) * 1000]);
    }
    sample.sort((a, b) => a - b);
    const top = sample[Math.floor(sample.length * 0.99)] || 0.001;
    // a round number of millimetres
    this.range = Math.max(1, [1, 2, 5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200].find((x) => x >= top * 1000 * 0.8) || 300) / 1000;
  }
  resetCamera() {
    this.camera = { target: [...this.home], distance: Math.max(1.2, this.size * 2.15), yaw: 0.5, pitch: 0.12 };
  }
  legend() {
    const ramp = RAMPS[this.colour].map((c) => `rgb(${c.map((x) => Math.round(x * 255))})`);
    this.by("legend-ramp").style.background = `linear-gradient(90deg, ${ramp})`;
    this.by("legend-high").textContent = this.colour === "plain" ? "" : this.range * 1000 + " mm";
    this.by("legend-low").textContent = this.colour === "plain" ? "" : "0";
    this.by("legend-ramp").hidden = this.colour === "plain";
    this.by("legend-name").textContent = { error: "distance from the reference", displacement: "distance from the body alone", plain: "" }[this.colour];
  }
  advance(seconds) {
    this.time = (this.time || 0) + seconds * +this.by("speed").value;
    const frames = Math.floor(this.time * this.clip.fps);
    if (frames < 1) return;
    this.time -= frames / this.clip.fps;
    this.show((this.frame + frames) % this.clip.frames);
  }
  show(t) {
    if (!this.clip) return;
    this.frame = t;
    const { alone, reference, predicted } = this.clip, v = this.data.mesh.vertices;
    const [toTruth, toPrediction] = [this.gain * reference.step, this.gain * predicted.step];
    for (let i = 0; i < v; i++) {
      let [d, p, e] = [0, 0, 0];
      for (let a = 0; a < 3; a++) {
        const at = (t * 3 + a) * v + i, k = i * 3 + a;
        const x = alone.q[at] * alone.step + alone.centre[a];
        this.positions[0][k] = x + reference.q[at] * toTruth;
        this.positions[1][k] = x;
        this.positions[2][k] = x + predicted.q[at] * toPrediction;
        const r = reference.q[at] * reference.step, q = predicted.q[at] * predicted.step;
        d += r * r; p += q * q; e += (q - r) ** 2;
      }
      const scale = 1 / this.range, error = this.colour === "error";
      this.values[0][i] = error ? 0 : Math.sqrt(d) * scale;
      this.values[1][i] = error ? Math.sqrt(d) * scale : 0;
      this.values[2][i] = Math.sqrt(error ? e : p) * scale;
    }
    if (this.follows) [this.camera.target[0], this.camera.target[2]] = this.path[t];
    const dark = getComputedStyle(document.body).color.match(/\d+/g)[0] > 128;
    const line = dark ? [0.22, 0.24, 0.26] : [0.80, 0.81, 0.82];
    this.views.forEach((view, i) => {
      this.smooth(this.positions[i]);
      view.draw(this.positions[i], this.normals, this.values[i], RAMPS[this.colour], this.camera, line);
    });
    this.by("time").value = t;
    this.by("clock").textContent = (t / this.clip.fps).toFixed(2) + " s";
    const mm = (name) => this.curves[name][t][1].toFixed(1) + " mm";
    this.readouts[0].textContent = "soft displacement " + mm("body");
    this.readouts[1].textContent = "error " + mm("body");
    this.readouts[2].textContent = "error " + mm(this.clip.method);
    this.seek(t / this.clip.fps);
  }
  // Area-weighted vertex normals; the shader normalises.
  smooth(p) {
    const n = this.normals.fill(0), f = this.faces;
    for (let i = 0; i < f.length; i += 3) {
      const [a, b, c] = [f[i] * 3, f[i + 1] * 3, f[i + 2] * 3];
      const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
      const wx = p[c] - p[a], wy = p[c + 1] - p[a + 1], wz = p[c + 2] - p[a + 2];
      const x = uy * wz - uz * wy, y = uz * wx - ux * wz, z = ux * wy - uy * wx;
      n[a] += x; n[a + 1] += y; n[a + 2] += z;
      n[b] += x; n[b + 1] += y; n[b + 2] += z;
      n[c] += x; n[c + 1] += y; n[c + 2] += z;
    }
  }
}
