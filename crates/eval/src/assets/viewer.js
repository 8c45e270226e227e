// Linked views of a clip's layers. A layer is a body with points of its own, or what is added to another.

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

// Colours of curves; a layer that is none of these takes one of the palette.
const LAYER_COLOURS = { reference: "var(--c-truth)", alone: "var(--c-body)", predicted: "var(--c-ours)" };
// Ends of the colour scale that can be chosen, millimetres.
const SCALES = [1, 2, 5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300];
const SKIN = RAMPS.plain;

class Player {
  constructor(data) {
    this.data = data;
    this.layers = data.layers;
    this.cache = new Map();
    this.frame = 0;
    this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.gain = 1;
    this.by = (id) => document.getElementById(id);
    // what is measured: distances from a layer, or displacements from one's own body
    this.colour = this.layers.length < 2 ? "plain" : data.reference === null ? "displacement" : "error";
    this.against = data.reference ?? this.layers.length - 1;
    this.scale = null;
  }
  async start() {
    const mesh = this.data.mesh, v = mesh.vertices;
    this.faces = new Uint32Array((await inflate(mesh.faces)).buffer);
    this.regions = mesh.regions && (await inflate(mesh.regions));
    this.panes = [...document.querySelectorAll("#viewer figure")].map((figure, i) => ({
      view: new View(figure.querySelector("canvas"), this.faces, v), readout: figure.querySelector(".readout"),
      chooser: figure.querySelector("select"), layer: i, positions: new Float32Array(v * 3), values: new Float32Array(v),
    }));
    this.normals = new Float32Array(v * 3);
    this.scratch = [new Float32Array(v * 3), new Float32Array(v * 3)];
    this.distances = new Float32Array(v);
    this.choose("soft");
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
    const on = (id, event, act) => this.by(id) && this.by(id).addEventListener(event, act);
    const remeasure = () => { this.measure(); this.show(this.frame); };
    on("clip", "change", (e) => this.load(+e.target.value));
    on("play", "click", () => this.setPlaying(!this.playing));
    on("time", "input", (e) => { this.setPlaying(false); this.show(+e.target.value); });
    on("colour", "change", (e) => { this.colour = e.target.value; remeasure(); });
    on("against", "change", (e) => { this.against = +e.target.value; remeasure(); });
    on("region", "change", (e) => { this.choose(e.target.value); remeasure(); });
    on("scale", "change", (e) => { this.scale = +e.target.value || null; remeasure(); });
    on("gain", "input", (e) => { this.gain = +e.target.value; this.by("gain-value").textContent = "× " + this.gain; this.show(this.frame); });
    on("reset", "click", () => { this.resetCamera(); this.show(this.frame); });
    document.addEventListener("keydown", (e) => {
      if (e.code !== "Space" || /^(SELECT|INPUT|BUTTON|SUMMARY|A)$/.test(e.target.tagName)) return;
      e.preventDefault();
      this.setPlaying(!this.playing);
    });
    for (const pane of this.panes) {
      this.drag(pane.view.canvas);
      if (pane.chooser) pane.chooser.addEventListener("change", () => { pane.layer = +pane.chooser.value; this.show(this.frame); });
    }
    new ResizeObserver(() => this.show(this.frame)).observe(this.by("viewer"));
    this.setPlaying(this.playing);
  }
  drag(canvas) {
    canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); this.shifting = e.shiftKey || e.button === 2; });
    canvas.addEventListener("contextmenu", (e) => e.preventDefault());
    canvas.addEventListener("pointermove", (e) => {
      if (!canvas.hasPointerCapture(e.pointerId)) return;
      if (this.shifting) {
        const [right, up] = axes(this.camera.yaw, this.camera.pitch);
        const metres = (this.camera.distance * 2 * Math.tan(0.275)) / canvas.clientHeight;
        this.camera.shift = this.camera.shift.map((x, a) => x + metres * (up[a] * e.movementY - right[a] * e.movementX));
      } else {
        this.camera.yaw -= e.movementX * 0.01;
        this.camera.pitch = Math.min(1.4, Math.max(-0.5, this.camera.pitch + e.movementY * 0.01));
      }
      this.show(this.frame);
    });
    canvas.addEventListener("wheel", (e) => {
      e.preventDefault();
      this.camera.distance = Math.min(12, Math.max(0.3, this.camera.distance * Math.exp(e.deltaY * 0.001)));
      this.show(this.frame);
    }, { passive: false });
  }
  setPlaying(playing) {
    this.playing = playing;
    if (this.by("play")) this.by("play").textContent = playing ? "❚❚" : "▶";
  }
  async load(index) {
    const clip = this.data.clips[index], v = this.data.mesh.vertices;
    if (!this.cache.has(index)) {
      this.cache.set(index, { ...clip, parts: await Promise.all(clip.layers.map((l) => unpack(l, clip.frames, v))) });
    }
    this.clip = this.cache.get(index);
    if (this.by("time")) this.by("time").max = clip.frames - 1;
    this.place();
    this.measure();
    this.resetCamera();
    this.panes.forEach((pane) => pane.view.grid(this.home, this.floor));
    this.show(Math.min(this.frame, clip.frames - 1));
  }
  seconds(t) {
    return this.clip.start + t / this.clip.fps;
  }
  // The layer with points of its own below a layer.
  root(layer) {
    return this.layers[layer].over === null ? layer : this.root(this.layers[layer].over);
  }
  // What a layer and those between add to its root in frame t, metres, [3, V].
  added(layer, t, out) {
    out.fill(0);
    for (let l = layer; this.layers[l].over !== null; l = this.layers[l].over) {
      const { q, step } = this.clip.parts[l], at = t * out.length;
      for (let i = 0; i < out.length; i++) out[i] += q[at + i] * step;
    }
  }
  // Distance of each vertex of a layer from another, or from its own root where `other` is null, metres.
  apart(layer, other, t) {
    const [a, b] = this.scratch, v = this.data.mesh.vertices, out = this.distances;
    this.added(layer, t, a);
    b.fill(0);
    if (other !== null) {
      this.added(other, t, b);
      if (this.root(layer) !== this.root(other)) [[layer, a], [other, b]].forEach(([l, to]) => this.addPoints(this.root(l), t, to));
    }
    for (let i = 0; i < v; i++) {
      const [x, y, z] = [a[i] - b[i], a[v + i] - b[v + i], a[2 * v + i] - b[2 * v + i]];
      out[i] = Math.sqrt(x * x + y * y + z * z);
    }
    return out;
  }
  addPoints(root, t, to) {
    const { q, step, centre } = this.clip.parts[root], v = this.data.mesh.vertices, at = t * to.length;
    for (let axis = 0; axis < 3; axis++) {
      for (let i = axis * v; i < (axis + 1) * v; i++) to[i] += q[at + i] * step + centre[axis];
    }
  }
  // Which vertices count: those of a region, `soft` or `all`. Of a single region the rest is not coloured.
  choose(region) {
    const { vertices, names, soft } = this.data.mesh;
    this.mask = new Uint8Array(vertices).fill(1);
    this.masked = false;
    this.regionWords = "all vertices";
    if (!this.regions || region === "all") return;
    const counts = (r) => (region === "soft" ? soft[r] : names[r] === region);
    this.mask = this.regions.map((r) => (counts(r) ? 1 : 0));
    this.masked = region !== "soft";
    this.regionWords = region === "soft" ? "soft parts" : region.replaceAll("-", " ");
  }
  // Bounds of the clip and the path of its middle.
  place() {
    const v = this.data.mesh.vertices, { frames } = this.clip;
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    this.layers.forEach((l, k) => {
      if (l.over !== null) return;
      const { q, step, centre } = this.clip.parts[k];
      for (let i = 0; i < q.length; i++) {
        const axis = Math.floor(i / v) % 3, x = q[i] * step + centre[axis];
        if (x < low[axis]) low[axis] = x;
        if (x > high[axis]) high[axis] = x;
      }
    });
    this.home = [0, 1, 2].map((a) => (low[a] + high[a]) / 2);
    this.floor = low[1];
    this.size = high[1] - low[1];
    // a body that walks away is followed; one that stays is not, so that its sway can be seen
    const { q, step, centre } = this.clip.parts[this.root(0)];
    this.path = [];
    for (let t = 0; t < frames; t++) {
      this.path.push([0, 2].map((axis) => {
        let sum = 0;
        for (let i = 0; i < v; i++) sum += q[(t * 3 + axis) * v + i];
        return (sum / v) * step + centre[axis];
      }));
    }
    const reach = Math.max(...[0, 1].map((k) => {
      const along = this.path.map((p) => p[k]);
      return along.reduce((a, b) => Math.max(a, b)) - along.reduce((a, b) => Math.min(a, b));
    }));
    this.follows = reach > 0.8;
  }
  // What a pane's layer is measured from, or null where there is nothing to measure: the reference, or, of the reference
  // itself and with the colours of displacements, its own body.
  base(layer) {
    if (this.colour !== "displacement" && layer !== this.against) return this.against;
    return this.layers[layer].over === null ? null : this.root(layer);
  }
  distancesOf(layer, t) {
    const base = this.base(layer);
    return this.apart(layer, base === this.root(layer) ? null : base, t);
  }
  // Curves of the mean distance, and the end of the colour scale.
  measure() {
    const { frames } = this.clip, v = this.data.mesh.vertices;
    let top = 0;
    this.curves = this.layers.map((_, layer) => {
      if (this.base(layer) === null) return null;
      const sample = [], curve = [];
      for (let t = 0; t < frames; t++) {
        const d = this.distancesOf(layer, t);
        let [sum, n] = [0, 0];
        for (let i = 0; i < v; i++) {
          if (!this.mask[i]) continue;
          sum += d[i]; n++;
          if ((t + i) % 7 === 0) sample.push(d[i]);
        }
        curve.push((sum / Math.max(n, 1)) * 1000);
      }
      sample.sort((a, b) => a - b);
      top = Math.max(top, (sample[Math.floor(sample.length * 0.99)] || 0) * 1000);
      return curve;
    });
    // a round number of millimetres
    this.range = (this.scale ?? (SCALES.find((x) => x >= top * 0.8) || SCALES.at(-1))) / 1000;
    this.legend();
    this.chart();
  }
  label(layer) {
    return this.layers[layer].label;
  }
  resetCamera() {
    this.camera = { shift: [0, 0, 0], distance: Math.max(1.2, this.size * 2.15), yaw: 0.5, pitch: 0.12 };
  }
  legend() {
    if (!this.by("legend-ramp")) return;
    const ramp = RAMPS[this.colour].map((c) => `rgb(${c.map((x) => Math.round(x * 255))})`);
    this.by("legend-ramp").parentElement.hidden = this.colour === "plain";
    this.by("legend-ramp").style.background = `linear-gradient(90deg, ${ramp})`;
    this.by("legend-high").textContent = this.range * 1000 + " mm";
    this.by("legend-low").textContent = "0";
    this.by("legend-name").textContent = this.colour === "error" ? `distance from ${this.words(this.against)}` : "displacement from the body alone";
    if (this.by("against")) this.by("against").disabled = this.colour === "displacement";
  }
  // A layer's name within a sentence.
  words(layer) {
    const label = this.label(layer);
    return /^[A-Z][a-z]/.test(label) ? label[0].toLowerCase() + label.slice(1) : label;
  }
  // The chart under the views; it is drawn again when the page changes its width.
  chart() {
    const host = this.by("chart-play");
    if (!host || !this.clip) return;
    const displaced = this.colour === "displacement";
    const shown = this.layers.flatMap((_, l) => (this.curves[l] && (displaced || l !== this.against) ? [l] : []));
    const points = (curve) => curve.map((y, t) => [this.seconds(t), y]);
    this.placeCursor = lineChart(host, {
      title: `${displaced ? "Mean displacement" : "Mean distance from " + this.words(this.against)}, ${this.regionWords}, mm`,
      unit: "mm", xUnit: "s", zero: true, height: 120,
      series: shown.map((l, i) => ({ name: this.layers[l].key, label: this.label(l), colour: LAYER_COLOURS[this.layers[l].key] || `var(--c${i % 7})`, points: points(this.curves[l]) })),
      seek: (seconds) => { this.setPlaying(false); this.show(Math.round((seconds - this.clip.start) * this.clip.fps)); },
    });
  }
  advance(seconds) {
    this.time = (this.time || 0) + seconds * +(this.by("speed")?.value ?? 1);
    const frames = Math.floor(this.time * this.clip.fps);
    if (frames < 1) return;
    this.time -= frames / this.clip.fps;
    this.show((this.frame + frames) % this.clip.frames);
  }
  show(t) {
    if (!this.clip) return;
    this.frame = Math.min(Math.max(t, 0), this.clip.frames - 1);
    this.camera.target = this.home.map((x, a) => x + this.camera.shift[a]);
    if (this.follows) [0, 2].forEach((a, k) => (this.camera.target[a] = this.path[this.frame][k] + this.camera.shift[a]));
    const dark = getComputedStyle(document.body).color.match(/\d+/g)[0] > 128;
    const line = dark ? [0.22, 0.24, 0.26] : [0.80, 0.81, 0.82];
    for (const pane of this.panes) {
      const measured = this.pose(pane, this.frame);
      this.smooth(pane.positions);
      pane.view.draw(pane.positions, this.normals, pane.values, measured ? RAMPS[this.colour] : SKIN, this.camera, line);
      const base = this.base(pane.layer), curve = this.curves[pane.layer];
      pane.readout.textContent = curve ? `${curve[this.frame].toFixed(1)} mm from ${this.words(base)}` : "";
    }
    if (this.by("time")) this.by("time").value = this.frame;
    if (this.by("clock")) this.by("clock").textContent = this.seconds(this.frame).toFixed(2) + " s";
    if (this.placeCursor) this.placeCursor(this.seconds(this.frame));
  }
  // Puts a pane's layer into its arrays; whether it has anything to colour. The reference itself keeps the colour of skin.
  pose(pane, t) {
    const v = this.data.mesh.vertices, [a, b] = this.scratch;
    const coloured = this.colour !== "plain" && this.base(pane.layer) !== null && (this.colour === "displacement" || pane.layer !== this.against);
    if (coloured) {
      const d = this.distancesOf(pane.layer, t), scale = 1 / this.range;
      for (let i = 0; i < v; i++) pane.values[i] = this.masked && !this.mask[i] ? 0 : d[i] * scale;
    } else {
      pane.values.fill(0);
    }
    this.added(pane.layer, t, a);
    b.fill(0);
    this.addPoints(this.root(pane.layer), t, b);
    for (let axis = 0; axis < 3; axis++) {
      for (let i = 0; i < v; i++) pane.positions[i * 3 + axis] = b[axis * v + i] + this.gain * a[axis * v + i];
    }
    return coloured;
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
