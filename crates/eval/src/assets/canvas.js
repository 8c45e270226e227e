// One view on plain WebGL, its colours and its camera.

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

// Column-major, as WebGL takes them.
function perspective(fieldOfView, aspect, near, far) {
  const f = 1 / Math.tan(fieldOfView / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
}

// Rows of the camera's rotation: right, up, back.
function axes(yaw, pitch) {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return [[cy, 0, -sy], [-sy * sp, cp, -cy * sp], [sy * cp, sp, cy * cp]];
}

function orbit(target, distance, yaw, pitch) {
  const [right, up, back] = axes(yaw, pitch);
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
