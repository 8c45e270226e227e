// Loads the bundle and the player, and runs the page.

import { Bundle, Module, Player } from "./module.js";
import { Motion, readClip } from "./motion.js";
import { Panel } from "./panel.js";
import { RAMP, View } from "./view.js";

const at = (id) => document.getElementById(id);
// Longest gap between two pictures that is played, seconds: after a longer one the page was out of sight.
const LONGEST_GAP = 0.1;
// For how long flesh catches up after a change, seconds, and what that may cost while it plays, milliseconds.
const CATCH_UP_MS = 60, CATCH_UP_S = 0.5;
// Pictures that the figures speak of.
const KEPT = 240;

async function fetched(name, progress = () => {}) {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name} cannot be loaded (${answer.status}): the folder is not whole`);
  const parts = [];
  let size = 0;
  for (const reader = answer.body.getReader(); ;) {
    const { done, value } = await reader.read();
    if (done) break;
    parts.push(value);
    progress((size += value.length));
  }
  const bytes = new Uint8Array(size);
  parts.reduce((to, part) => (bytes.set(part, to), to + part.length), 0);
  return bytes;
}

class Times {
  constructor() {
    this.kept = [];
  }
  add(value) {
    this.kept.push(value);
    if (this.kept.length > KEPT) this.kept.shift();
  }
  get mean() {
    return this.kept.reduce((a, b) => a + b, 0) / Math.max(this.kept.length, 1);
  }
  get most() {
    const sorted = [...this.kept].sort((a, b) => a - b);
    return sorted[Math.max(Math.ceil(0.95 * sorted.length) - 1, 0)] || 0;
  }
}

class Page {
  constructor(facts, bundle) {
    Object.assign(this, { facts, bundle });
    this.view = new View(at("view"), bundle.faces, bundle.vertices);
    this.values = new Float32Array(bundle.vertices);
    this.motions = facts.motions.map((m) => ({ ...m, motion: null }));
    this.time = 0;
    this.playing = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.times = { player: new Times(), drawing: new Times(), picture: new Times() };
    // A round number of millimetres, about a third of the training's largest displacement: most stay far under that.
    const top = facts.largest_delta_m * 350;
    this.range = ([1, 2, 5, 10, 15, 20, 30, 40, 50, 60, 80, 100, 150, 200].find((x) => x >= top) || 300) / 1000;
    at("legend-high").textContent = this.range * 1000 + " mm";
    at("legend").querySelector("i").style.background = `linear-gradient(90deg, ${RAMP.map((c) => `rgb(${c.map((x) => Math.round(x * 255))})`)})`;
    this.panel = new Panel(facts, bundle.shapes, () => { this.stale = true; });
    this.motions.forEach((m, i) => at("motion").add(new Option(m.name, i)));
    this.bind();
  }
  bind() {
    const on = (id, event, act) => at(id).addEventListener(event, act);
    on("motion", "change", (e) => this.choose(+e.target.value).catch(refuse));
    on("file", "change", (e) => e.target.files[0] && this.take(e.target.files[0]));
    on("play", "click", () => this.setPlaying(!this.playing));
    on("time", "input", (e) => { this.setPlaying(false); this.time = +e.target.value; this.stale = true; });
    on("colours", "change", () => { at("legend").hidden = !at("colours").checked; this.changed = true; });
    on("reset", "click", () => this.resetCamera());
    on("theme", "click", () => this.switchTheme());
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.readColours());
    new ResizeObserver(() => { this.changed = true; }).observe(at("stage"));
    addEventListener("keydown", (e) => {
      if (e.code === "Space" && !/INPUT|SELECT|BUTTON/.test(e.target.tagName)) { e.preventDefault(); this.setPlaying(!this.playing); }
    });
    this.bindCamera(at("view"));
    this.bindDrop();
  }
  bindCamera(canvas) {
    const turn = (x, y) => {
      this.camera.yaw -= x * 0.01;
      this.camera.pitch = Math.min(1.4, Math.max(-0.3, this.camera.pitch + y * 0.01));
      this.changed = true;
    };
    const zoom = (factor) => {
      this.camera.distance = Math.min(15, Math.max(0.6, this.camera.distance * factor));
      this.changed = true;
    };
    const fingers = new Map();
    canvas.addEventListener("pointerdown", (e) => { canvas.setPointerCapture(e.pointerId); fingers.set(e.pointerId, [e.clientX, e.clientY]); });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, (e) => fingers.delete(e.pointerId));
    canvas.addEventListener("pointermove", (e) => {
      const last = fingers.get(e.pointerId);
      if (!last) return;
      const apart = () => { const [a, b] = [...fingers.values()]; return Math.hypot(a[0] - b[0], a[1] - b[1]); };
      const before = fingers.size === 2 && apart();
      fingers.set(e.pointerId, [e.clientX, e.clientY]);
      if (fingers.size === 1) turn(e.clientX - last[0], e.clientY - last[1]);
      else if (before) zoom(before / Math.max(apart(), 1));
    });
    canvas.addEventListener("wheel", (e) => { e.preventDefault(); zoom(Math.exp(e.deltaY * 0.001)); }, { passive: false });
    const keys = { ArrowLeft: [-12, 0], ArrowRight: [12, 0], ArrowUp: [0, -12], ArrowDown: [0, 12] };
    canvas.addEventListener("keydown", (e) => {
      if (keys[e.key]) { e.preventDefault(); turn(...keys[e.key]); }
      if (e.key === "+" || e.key === "-") zoom(e.key === "+" ? 0.9 : 1.1);
    });
  }
  bindDrop() {
    let depth = 0;
    const show = (by) => { depth = Math.max(0, by === 0 ? 0 : depth + by); at("drop").hidden = depth === 0; };
    addEventListener("dragenter", (e) => { e.preventDefault(); show(1); });
    addEventListener("dragleave", () => show(-1));
    addEventListener("dragover", (e) => e.preventDefault());
    addEventListener("drop", (e) => { e.preventDefault(); show(0); if (e.dataTransfer.files[0]) this.take(e.dataTransfer.files[0]); });
  }
  // A motion that somebody brings.
  async take(file) {
    try {
      const bytes = new Uint8Array(await file.arrayBuffer()), bvh = /\.bvh$/i.test(file.name);
      const clip = bvh ? this.bundle.motion(file.name, bytes, this.panel.beta) : readClip(bytes, file.name);
      const index = this.motions.push({ name: file.name, motion: this.checked(clip) }) - 1;
      at("motion").add(new Option(file.name, index));
      await this.choose(index);
    } catch (error) {
      at("facts").textContent = error.message;
      at("facts").className = "note bad";
    }
  }
  checked(clip) {
    const { joints } = this.bundle;
    if (clip.joints !== joints) throw new Error(`${clip.name} has ${clip.joints} joints, but the body has ${joints}; bring it as BVH`);
    return new Motion(clip);
  }
  async choose(index) {
    const entry = this.motions[index];
    if (!entry.motion) entry.motion = this.checked(readClip(await fetched(entry.file), entry.name));
    at("motion").value = index;
    at("facts").textContent = entry.motion.facts || "";
    at("facts").className = "note";
    this.motion = entry.motion;
    this.time = 0;
    at("time").max = this.motion.seconds;
    this.renew();
    this.resetCamera();
  }
  // A player as the sliders say, its flesh moving as if it had played all along.
  renew() {
    this.stale = false;
    const { motion, panel, bundle } = this;
    if (this.player) this.player.free();
    this.player = new Player(bundle, panel.beta, panel.controls());
    // Bodies of every height stand on the same floor.
    motion.sample(0);
    this.player.step(motion.pose, motion.root, 0);
    const low = (p) => { let y = Infinity; for (let i = 1; i < p.length; i += 3) y = Math.min(y, p[i]); return y; };
    this.floor ??= low(this.player.alone());
    this.lift = this.floor - low(this.player.alone());
    this.player.reset();
    const frame = 1 / bundle.fps, cost = Math.max(this.times.player.mean, 0.5);
    const affordable = this.playing ? Math.floor(CATCH_UP_MS / cost) : Infinity;
    let frames = Math.min(Math.floor(Math.min(this.time, CATCH_UP_S) / frame), affordable);
    for (; frames >= 0; frames--) this.play(this.time - frames * frame, frame);
    this.shown();
  }
  play(time, dt) {
    this.motion.sample(time);
    this.motion.root[1] += this.lift;
    this.player.step(this.motion.pose, this.motion.root, dt);
  }
  shown() {
    const d = this.player.deltas(), values = this.values, scale = 1 / this.range;
    for (let i = 0; i < values.length; i++) values[i] = Math.hypot(d[3 * i], d[3 * i + 1], d[3 * i + 2]) * scale;
    this.trust = Math.min(this.trust ?? 1, this.player.trust());
    this.changed = true;
  }
  advance(seconds) {
    const start = performance.now();
    // The player computes at the bundle's rate, whatever the screen's is.
    this.phase = (this.phase || 0) + seconds * this.bundle.fps;
    const frames = Math.floor(this.phase);
    this.phase -= frames;
    this.time += seconds;
    if (this.time >= this.motion.seconds) {
      this.time = this.motion.loops ? this.time % this.motion.seconds : 0;
      if (!this.motion.loops) this.player.reset();
    }
    this.play(this.time, seconds);
    if (frames) this.times.player.add((performance.now() - start) / frames);
    this.shown();
  }
  setPlaying(playing) {
    this.playing = playing;
    at("play").textContent = playing ? "❚❚" : "▶";
  }
  resetCamera() {
    const [x, , z] = this.motion.translations, tall = this.facts.height[0], { clientWidth, clientHeight } = at("view");
    // Far enough for head and feet, and for arms that are spread out in a narrow picture.
    const far = Math.min(3.6, Math.max(2.75, (1.75 * clientHeight) / (clientWidth / 2)));
    this.camera = { target: [x, this.floor + 0.5 * tall, z], floor: this.floor, distance: far * tall, yaw: 0.5, pitch: 0.12 };
    this.changed = true;
  }
  switchTheme() {
    const root = document.documentElement, system = matchMedia("(prefers-color-scheme: dark)").matches;
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : system;
    root.dataset.theme = dark ? "light" : "dark";
    this.readColours();
  }
  readColours() {
    const probe = getComputedStyle(at("stage")).backgroundColor.match(/[\d.]+/g).slice(0, 3).map((x) => x / 255);
    const dark = probe[1] < 0.5, mixed = (x, part) => probe.map((c) => c + part * (x - c));
    this.colours = {
      stage: probe, line: mixed(dark ? 1 : 0, dark ? 0.1 : 0.09), shadow: mixed(0, dark ? 0.32 : 0.13),
      sky: dark ? [0.5, 0.52, 0.55] : [0.56, 0.57, 0.58], ground: dark ? [0.2, 0.2, 0.21] : [0.3, 0.29, 0.28],
    };
    this.changed = true;
  }
  draw() {
    this.changed = false;
    const start = performance.now();
    if (this.motion.travels) [this.camera.target[0], this.camera.target[2]] = [this.motion.root[0], this.motion.root[2]];
    const values = at("colours").checked ? this.values : null;
    this.view.draw([{ positions: this.player.alone() }, { positions: this.player.soft(), values }], this.camera, this.colours);
    this.times.drawing.add(performance.now() - start);
    at("time").value = this.time;
    at("clock").textContent = `${this.time.toFixed(2)} / ${this.motion.seconds.toFixed(2)} s`;
  }
  say() {
    const { player, drawing, picture } = this.times, ms = (x) => x.toFixed(2) + " ms";
    // The least of what was shown since these figures were last said; where nothing was, as said then.
    this.said = this.trust ?? this.said;
    const said = this.said === undefined ? [] : [`Trust ${this.said.toFixed(2)}`];
    if (player.kept.length) {
      said.push(`player ${ms(player.mean)} a frame, 95 % under ${ms(player.most)}`, `drawing ${ms(drawing.mean)}`);
      if (picture.kept.length) said.push(`${(1000 / picture.mean).toFixed(0)} pictures a second`);
    } else {
      said.push(`${this.bundle.vertices} vertices`);
    }
    at("figures").textContent = said.join(" · ");
    this.trust = undefined;
  }
  start() {
    let last = null, said = 0;
    this.setPlaying(this.playing);
    this.readColours();
    const tick = (now) => {
      requestAnimationFrame(tick);
      const gap = last === null ? 0 : (now - last) / 1000;
      last = now;
      try {
        if (this.stale) this.renew();
        if (this.playing && gap > 0) {
          this.times.picture.add(1000 * gap);
          this.advance(Math.min(gap, LONGEST_GAP) * +at("speed").value);
        }
        if (this.changed) this.draw();
      } catch (error) {
        this.setPlaying(false);
        refuse(error);
      }
      if (now - said > 500) { said = now; this.say(); }
    };
    requestAnimationFrame(tick);
  }
}

function refuse(error) {
  at("notice").hidden = false;
  at("notice").className = "notice bad";
  at("notice-text").textContent = `The page cannot go on: ${error.message}.`;
  at("loading").hidden = true;
  console.error(error);
}

async function start() {
  at("notice-text").textContent = "Loading …";
  const facts = JSON.parse(new TextDecoder().decode(await fetched("facts.json")));
  document.title = facts.title;
  at("title").textContent = facts.title;
  at("subtitle").textContent = `Method ${facts.method}, licence ${facts.licence}`;
  const loaded = {};
  const say = (name) => (size) => {
    loaded[name] = size;
    const all = Object.values(loaded).reduce((a, b) => a + b, 0);
    at("notice-text").textContent = `Loading the model: ${(all / 1e6).toFixed(0)} MB of ${(facts.bytes / 1e6).toFixed(0)} MB`;
    at("loading").hidden = false;
    at("loading").value = all / facts.bytes;
  };
  const names = ["player.wasm", ...facts.bundle];
  const [player, ...files] = await Promise.all(names.map((name) => fetched(name, say(name))));
  const page = new Page(facts, new Bundle(await Module.from(player), files));
  // For the browser's console and for tests.
  window.softtissue = { page, Player, Motion };
  await page.choose(0);
  page.start();
  at("notice").hidden = true;
  document.documentElement.dataset.ready = "yes";
}

start().catch(refuse);
