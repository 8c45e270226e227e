// Two bodies side by side on plain WebGL 2: body alone and body with soft tissue, under one camera.

const BODY_VERTEX = `#version 300 es
in vec3 position; in vec3 normal; in float value;
uniform mat4 view, projection;
out vec3 eyeNormal, eye; out float shade;
void main() {
  vec4 p = view * vec4(position, 1.0);
  eye = p.xyz; eyeNormal = mat3(view) * normal; shade = value;
  gl_Position = projection * p;
}`;
const BODY_FRAGMENT = `#version 300 es
precision highp float;
in vec3 eyeNormal, eye; in float shade;
uniform vec3 ramp[5]; uniform vec3 sky, ground;
out vec4 colour;
void main() {
  float x = clamp(shade, 0.0, 1.0) * 4.0;
  vec3 c = mix(ramp[0], ramp[1], clamp(x, 0.0, 1.0));
  c = mix(c, ramp[2], clamp(x - 1.0, 0.0, 1.0));
  c = mix(c, ramp[3], clamp(x - 2.0, 0.0, 1.0));
  c = mix(c, ramp[4], clamp(x - 3.0, 0.0, 1.0));
  vec3 n = normalize(eyeNormal), v = normalize(-eye);
  vec3 keyAt = normalize(vec3(0.45, 0.75, 0.6));
  float key = max(dot(n, keyAt), 0.0);
  float fill = max(dot(n, normalize(vec3(-0.8, 0.1, 0.45))), 0.0);
  float gloss = pow(max(dot(n, normalize(keyAt + v)), 0.0), 28.0);
  float rim = pow(1.0 - max(dot(n, v), 0.0), 3.0);
  vec3 lit = c * (mix(ground, sky, 0.5 + 0.5 * n.y) + vec3(0.68, 0.66, 0.63) * key + vec3(0.12, 0.14, 0.18) * fill);
  colour = vec4(lit + vec3(0.06) * gloss + 0.10 * rim * sky, 1.0);
}`;
// The shadow: every vertex along the light onto the floor.
const SHADOW_VERTEX = `#version 300 es
in vec3 position;
uniform mat4 view, projection; uniform float floorAt; uniform vec3 centre;
out vec2 away;
void main() {
  float h = position.y - floorAt;
  vec3 p = vec3(position.x - 0.42 * h, floorAt + 0.001, position.z - 0.34 * h);
  away = (p - centre).xz;
  gl_Position = projection * view * vec4(p, 1.0);
}`;
const FADE_FRAGMENT = `#version 300 es
precision highp float;
in vec2 away; uniform vec3 tint, stage; uniform float reach;
out vec4 colour;
void main() { colour = vec4(mix(tint, stage, smoothstep(0.25 * reach, reach, length(away))), 1.0); }`;
const FLOOR_VERTEX = `#version 300 es
in vec3 position;
uniform mat4 view, projection; uniform vec3 centre;
out vec2 away;
void main() { away = (position - centre).xz; gl_Position = projection * view * vec4(position, 1.0); }`;

const PLAIN = [0.84, 0.8, 0.77];
// No displacement to much of it, 0..1 a channel.
export const RAMP = [PLAIN, [0.6, 0.84, 0.8], [0.22, 0.66, 0.72], [0.12, 0.42, 0.62], [0.12, 0.18, 0.42]];
const GRID_STEP = 0.25, GRID_REACH = 2.5;

// Column-major, as WebGL takes them.
function perspective(fieldOfView, aspect, near, far) {
  const f = 1 / Math.tan(fieldOfView / 2);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1, 0, 0, (2 * far * near) / (near - far), 0];
}

function orbit(target, distance, yaw, pitch) {
  const [cy, sy, cp, sp] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  const right = [cy, 0, -sy], up = [-sy * sp, cp, -cy * sp], back = [sy * cp, sp, cy * cp];
  const dot = (a) => a[0] * target[0] + a[1] * target[1] + a[2] * target[2];
  return [right[0], up[0], back[0], 0, right[1], up[1], back[1], 0, right[2], up[2], back[2], 0, -dot(right), -dot(up), -dot(back) - distance, 1];
}

export class View {
  constructor(canvas, faces, vertices) {
    this.canvas = canvas;
    this.faces = faces;
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error("this browser gives no WebGL 2, which the page draws with");
    this.gl = gl;
    this.body = this.program(BODY_VERTEX, BODY_FRAGMENT);
    this.shadow = this.program(SHADOW_VERTEX, FADE_FRAGMENT);
    this.floor = this.program(FLOOR_VERTEX, FADE_FRAGMENT);
    const index = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, index);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
    this.buffers = {};
    for (const [name, size] of [["position", 3], ["normal", 3], ["value", 1]]) {
      this.buffers[name] = gl.createBuffer();
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, 4 * size * vertices, gl.DYNAMIC_DRAW);
    }
    this.buffers.grid = gl.createBuffer();
    this.normals = new Float32Array(3 * vertices);
    this.still = new Float32Array(vertices);
    gl.enable(gl.DEPTH_TEST);
  }
  program(vertex, fragment) {
    const gl = this.gl, program = gl.createProgram();
    for (const [type, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const named = (count, info, place) => Object.fromEntries(Array.from({ length: gl.getProgramParameter(program, count) }, (_, i) => {
      const name = gl[info](program, i).name.replace("[0]", "");
      return [name, gl[place](program, name)];
    }));
    return { program, uniforms: named(gl.ACTIVE_UNIFORMS, "getActiveUniform", "getUniformLocation"), attributes: named(gl.ACTIVE_ATTRIBUTES, "getActiveAttrib", "getAttribLocation") };
  }
  // `bodies`: { positions, values or null } from left to right.
  draw(bodies, camera, colours) {
    const gl = this.gl, ratio = Math.min(devicePixelRatio || 1, 2);
    const [w, h] = [Math.round(this.canvas.clientWidth * ratio), Math.round(this.canvas.clientHeight * ratio)];
    if (this.canvas.width !== w || this.canvas.height !== h) { this.canvas.width = w; this.canvas.height = h; }
    const wide = Math.floor(w / bodies.length);
    this.view = orbit(camera.target, camera.distance, camera.yaw, camera.pitch);
    this.projection = perspective(0.5, wide / h, 0.1, 60);
    gl.viewport(0, 0, w, h);
    gl.clearColor(...colours.stage, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    bodies.forEach((body, i) => {
      gl.viewport(i * wide, 0, wide, h);
      this.fill("position", body.positions);
      gl.depthMask(false);
      this.drawShadow(camera, colours);
      this.drawGrid(camera, colours);
      gl.depthMask(true);
      this.drawBody(body, colours);
    });
  }
  begin(part, uniforms) {
    const gl = this.gl;
    gl.useProgram(part.program);
    gl.uniformMatrix4fv(part.uniforms.view, false, this.view);
    gl.uniformMatrix4fv(part.uniforms.projection, false, this.projection);
    for (const [name, value] of Object.entries(uniforms)) {
      if (typeof value === "number") gl.uniform1f(part.uniforms[name], value);
      else gl.uniform3fv(part.uniforms[name], value);
    }
    for (let i = 0; i < 3; i++) gl.disableVertexAttribArray(i);
  }
  bind(part, name, buffer, size) {
    const gl = this.gl, place = part.attributes[name];
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[buffer]);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
  }
  fill(name, data) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.buffers[name]);
    this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, data);
  }
  drawShadow(camera, colours) {
    const gl = this.gl, centre = [camera.target[0], camera.floor, camera.target[2]];
    this.begin(this.shadow, { floorAt: camera.floor, centre, tint: colours.shadow, stage: colours.stage, reach: 1.9 });
    this.bind(this.shadow, "position", "position", 3);
    gl.drawElements(gl.TRIANGLES, this.faces.length, gl.UNSIGNED_INT, 0);
  }
  // Lines that stay where the floor is, around whoever stands on it.
  drawGrid(camera, colours) {
    const gl = this.gl, [x, z] = [0, 2].map((k) => Math.round(camera.target[k] / GRID_STEP) * GRID_STEP), lines = [];
    for (let at = -GRID_REACH; at <= GRID_REACH + 1e-6; at += GRID_STEP) {
      lines.push(x + at, camera.floor, z - GRID_REACH, x + at, camera.floor, z + GRID_REACH);
      lines.push(x - GRID_REACH, camera.floor, z + at, x + GRID_REACH, camera.floor, z + at);
    }
    this.begin(this.floor, { centre: [camera.target[0], camera.floor, camera.target[2]], tint: colours.line, stage: colours.stage, reach: GRID_REACH });
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.grid);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(lines), gl.DYNAMIC_DRAW);
    this.bind(this.floor, "position", "grid", 3);
    gl.drawArrays(gl.LINES, 0, lines.length / 3);
  }
  drawBody(body, colours) {
    const gl = this.gl;
    this.smooth(body.positions);
    this.fill("normal", this.normals);
    this.fill("value", body.values || this.still);
    this.begin(this.body, { ramp: RAMP.flat(), sky: colours.sky, ground: colours.ground });
    this.bind(this.body, "position", "position", 3);
    this.bind(this.body, "normal", "normal", 3);
    this.bind(this.body, "value", "value", 1);
    gl.drawElements(gl.TRIANGLES, this.faces.length, gl.UNSIGNED_INT, 0);
  }
  // Area-weighted vertex normals; the shader normalises.
  smooth(p) {
    const n = this.normals.fill(0), f = this.faces;
    for (let i = 0; i < f.length; i += 3) {
      const a = f[i] * 3, b = f[i + 1] * 3, c = f[i + 2] * 3;
      const ux = p[b] - p[a], uy = p[b + 1] - p[a + 1], uz = p[b + 2] - p[a + 2];
      const wx = p[c] - p[a], wy = p[c + 1] - p[a + 1], wz = p[c + 2] - p[a + 2];
      const x = uy * wz - uz * wy, y = uz * wx - ux * wz, z = ux * wy - uy * wx;
      n[a] += x; n[a + 1] += y; n[a + 2] += z;
      n[b] += x; n[b + 1] += y; n[b + 2] += z;
      n[c] += x; n[c + 1] += y; n[c + 2] += z;
    }
  }
}
