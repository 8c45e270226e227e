// The player: the C library of softtissue.h as a WebAssembly module.

const FAILED = 1 << 30;

export class Module {
  static async from(bytes) {
    const { instance } = await WebAssembly.instantiate(bytes, {});
    return new Module(instance.exports);
  }
  constructor(calls) {
    this.calls = calls;
  }
  // Views into the module's memory: good until it grows, so they are made anew wherever they are needed.
  floats(at, count) {
    return new Float32Array(this.calls.memory.buffer, at, count);
  }
  text(at) {
    const bytes = new Uint8Array(this.calls.memory.buffer, at);
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }
  error() {
    return new Error(this.text(this.calls.softtissue_error()));
  }
  room(size) {
    const at = this.calls.softtissue_allocate(size);
    if (!at) throw new Error(`there is no memory left for ${size} bytes`);
    return at;
  }
  // Copies arrays in for the time of a call: `act` gets where they lie.
  lend(arrays, act) {
    const parts = arrays.map((a) => (typeof a === "string" ? new TextEncoder().encode(a + "\0") : new Uint8Array(a.buffer, a.byteOffset, a.byteLength)));
    const places = parts.map((p) => this.room(p.length));
    try {
      parts.forEach((p, i) => new Uint8Array(this.calls.memory.buffer, places[i], p.length).set(p));
      return act(...places);
    } finally {
      parts.forEach((p, i) => this.calls.softtissue_release(places[i], p.length));
    }
  }
}

export class Bundle {
  // `files`: manifest, body and model as Uint8Array.
  constructor(module, files) {
    this.module = module;
    const { calls } = module;
    this.at = module.lend(files, (a, b, c) => calls.softtissue_bundle_from_memory(a, files[0].length, b, files[1].length, c, files[2].length));
    if (!this.at) throw module.error();
    this.vertices = calls.softtissue_vertex_count(this.at);
    this.joints = calls.softtissue_joint_count(this.at);
    this.shapes = calls.softtissue_shape_count(this.at);
    this.fps = calls.softtissue_frames_per_second(this.at);
    const faces = new Uint32Array(calls.memory.buffer, calls.softtissue_faces(this.at), 3 * calls.softtissue_face_count(this.at));
    this.faces = faces.slice();
  }
  // A BVH file on a body of this shape.
  motion(name, bytes, shape) {
    const { module, joints } = this, { calls } = module;
    const beta = Float32Array.from(shape);
    const at = module.lend([beta, name, bytes], (b, n, f) => calls.softtissue_motion_from_bvh(this.at, b, beta.length, n, f, bytes.length));
    if (!at) throw module.error();
    const frames = calls.softtissue_motion_length(at);
    const motion = {
      name, frames, joints, fps: this.fps,
      rotations: module.floats(calls.softtissue_motion_rotations(at), 3 * joints * frames).slice(),
      translations: module.floats(calls.softtissue_motion_translations(at), 3 * frames).slice(),
      facts: module.text(calls.softtissue_motion_facts(at)),
    };
    calls.softtissue_motion_free(at);
    return motion;
  }
}

export class Player {
  // `controls`: [region, gain, softness] of what is not as learned.
  constructor(bundle, shape, controls = []) {
    this.bundle = bundle;
    this.module = bundle.module;
    const { calls } = this.module;
    const beta = Float32Array.from(shape);
    this.at = this.module.lend([beta], (b) => calls.softtissue_player_new(bundle.at, b, beta.length));
    if (!this.at) throw this.module.error();
    this.sizes = { rotations: 12 * bundle.joints, root: 12, soft: 12 * bundle.vertices, alone: 12 * bundle.vertices };
    this.places = Object.fromEntries(Object.entries(this.sizes).map(([name, size]) => [name, this.module.room(size)]));
    for (const [region, gain, softness] of controls) {
      const done = this.module.lend([region], (r) => calls.softtissue_control(this.at, r, gain, softness, 1, 0));
      if (done !== 0) throw this.module.error();
    }
  }
  free() {
    for (const name in this.places) this.module.calls.softtissue_release(this.places[name], this.sizes[name]);
    this.module.calls.softtissue_player_free(this.at);
    this.at = 0;
  }
  reset() {
    this.module.calls.softtissue_reset(this.at);
  }
  // One frame, `dt` seconds after the last; 0 stands for one frame of the bundle's rate.
  step(rotations, root, dt) {
    const { places, module } = this, { calls } = module;
    module.floats(places.rotations, rotations.length).set(rotations);
    module.floats(places.root, 3).set(root);
    const bits = calls.softtissue_step(this.at, places.rotations, places.root, dt, places.soft);
    if (bits & FAILED) throw module.error();
    return bits;
  }
  // Posed vertices with soft tissue, of the newest frame.
  soft() {
    return this.module.floats(this.places.soft, 3 * this.bundle.vertices);
  }
  // Posed vertices of the body without it.
  alone() {
    if (this.module.calls.softtissue_body_alone(this.at, this.places.alone) !== 0) throw this.module.error();
    return this.module.floats(this.places.alone, 3 * this.bundle.vertices);
  }
  // Trust in the newest frame: 1 where motion and body are like those of the training, 0 far from them.
  trust() {
    return this.module.calls.softtissue_trust(this.at);
  }
  // Displacements of the rest mesh.
  deltas() {
    return this.module.floats(this.module.calls.softtissue_deltas(this.at), 3 * this.bundle.vertices);
  }
}
