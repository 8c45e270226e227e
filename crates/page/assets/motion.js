// Motions: read, sampled at any time, made to end where they begin.

// A motion that ends this near to where it began is eased back to its first pose over this long; one that travels starts over.
const NEAR_M = 0.6, EASE_S = 0.7;

// Reads a motion clip (a safetensors file): rotations [T, J, 3], axis times angle, and translations [T, 3].
export function readClip(bytes, name) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const refuse = (why) => new Error(`${name} is no motion of this page: ${why}`);
  if (bytes.length < 8) throw refuse("it is empty");
  const length = Number(view.getBigUint64(0, true));
  if (length > bytes.length - 8) throw refuse("it is cut off");
  let header;
  try {
    header = JSON.parse(new TextDecoder().decode(bytes.subarray(8, 8 + length)));
  } catch {
    throw refuse("its header cannot be read");
  }
  const facts = header.__metadata__ || {};
  if (facts.kind !== "motion") throw refuse("`softtissue import motion` makes one");
  const array = (key) => {
    const [from, to] = header[key].data_offsets;
    const part = bytes.slice(8 + length + from, 8 + length + to);
    return new Float32Array(part.buffer, 0, part.length >> 2);
  };
  const [frames, joints] = header.rotations.shape;
  return { name, frames, joints, fps: +facts.fps, rotations: array("rotations"), translations: array("translations") };
}

function quaternion(w, at, out) {
  const [x, y, z] = [w[at], w[at + 1], w[at + 2]], angle = Math.hypot(x, y, z);
  const s = angle > 1e-8 ? Math.sin(angle / 2) / angle : 0.5;
  out[0] = x * s; out[1] = y * s; out[2] = z * s; out[3] = Math.cos(angle / 2);
}

// Between two rotations along the shorter way, as axis times angle.
function between(a, b, part, out, at) {
  let cos = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const sign = cos < 0 ? -1 : 1;
  cos = Math.min(1, cos * sign);
  const angle = Math.acos(cos), small = angle < 1e-4;
  const p = small ? 1 - part : Math.sin((1 - part) * angle) / Math.sin(angle);
  const q = (small ? part : Math.sin(part * angle) / Math.sin(angle)) * sign;
  let [x, y, z, w] = [0, 1, 2, 3].map((k) => p * a[k] + q * b[k]);
  if (w < 0) [x, y, z, w] = [-x, -y, -z, -w];
  const sine = Math.hypot(x, y, z), factor = sine > 1e-8 ? (2 * Math.atan2(sine, w)) / sine : 2;
  out[at] = x * factor; out[at + 1] = y * factor; out[at + 2] = z * factor;
}

export class Motion {
  constructor(clip) {
    Object.assign(this, clip);
    this.seconds = (this.frames - 1) / this.fps;
    const p = this.translations, last = 3 * (this.frames - 1);
    const apart = (a, b) => Math.hypot(p[a] - p[b], p[a + 2] - p[b + 2]);
    this.loops = apart(0, last) < NEAR_M && this.seconds > 3 * EASE_S;
    let reach = 0;
    for (let t = 0; t <= last; t += 3) reach = Math.max(reach, apart(0, t));
    this.travels = reach > 0.8;
    this.pose = new Float32Array(3 * this.joints);
    this.root = new Float32Array(3);
    this.quaternions = [new Float64Array(4), new Float64Array(4)];
  }
  // Sets `pose` and `root` to the motion at this time, seconds.
  sample(seconds) {
    const at = Math.min(Math.max(seconds, 0), this.seconds) * this.fps;
    const t = Math.min(Math.floor(at), Math.max(this.frames - 2, 0));
    this.blend(this.rotations, 3 * this.joints * t, 3 * this.joints * Math.min(t + 1, this.frames - 1), 3 * t, 3 * Math.min(t + 1, this.frames - 1), at - t);
    const left = (this.seconds - seconds) / EASE_S;
    if (this.loops && left < 1) {
      const x = 1 - Math.max(left, 0), part = x * x * (3 - 2 * x);
      this.ease(part);
    }
  }
  blend(w, from, to, rootFrom, rootTo, part) {
    const [a, b] = this.quaternions, p = this.translations;
    for (let j = 0; j < 3 * this.joints; j += 3) {
      quaternion(w, from + j, a);
      quaternion(w, to + j, b);
      between(a, b, part, this.pose, j);
    }
    for (let k = 0; k < 3; k++) this.root[k] = p[rootFrom + k] + part * (p[rootTo + k] - p[rootFrom + k]);
  }
  // Towards the first frame.
  ease(part) {
    const [a, b] = this.quaternions;
    for (let j = 0; j < 3 * this.joints; j += 3) {
      quaternion(this.pose, j, a);
      quaternion(this.rotations, j, b);
      between(a, b, part, this.pose, j);
    }
    for (let k = 0; k < 3; k++) this.root[k] += part * (this.translations[k] - this.root[k]);
  }
}
