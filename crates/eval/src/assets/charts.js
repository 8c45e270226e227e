"use strict";
// Charts as inline SVG, drawn from plain arrays; no library.

const SVG = "http://www.w3.org/2000/svg";

function make(name, attributes, parent) {
  const node = document.createElementNS(SVG, name);
  for (const key in attributes) node.setAttribute(key, attributes[key]);
  if (parent) parent.appendChild(node);
  return node;
}

function element(name, className, text) {
  const node = document.createElement(name);
  if (className) node.className = className;
  if (text !== undefined) node.textContent = text;
  return node;
}

// Round steps that divide a range into about `count` parts.
function ticks(low, high, count) {
  const raw = (high - low) / count || 1;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 2.5, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const out = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i++) out.push(i * step);
  return out;
}

// Logarithms of 1, 2 and 5 times powers of ten; of the powers alone where the range is wide.
function decades(low, high) {
  const out = [];
  for (let power = Math.floor(low); power <= high; power++) {
    for (const m of high - low > 2.5 ? [1] : [1, 2, 5]) {
      const t = power + Math.log10(m);
      if (t >= low && t <= high) out.push(t);
    }
  }
  return out;
}

function shortNumber(x) {
  const size = Math.abs(x);
  if (size >= 1000) return Math.round(x).toLocaleString("en");
  if (size !== 0 && size < 0.001) return x.toExponential(0);
  return String(+x.toPrecision(3));
}

const tip = element("div", "tip");
tip.hidden = true;

function showTip(event, rows) {
  tip.replaceChildren(...rows.map(([colour, text]) => {
    const line = element("div");
    if (colour) {
      const dot = element("i");
      dot.style.background = colour;
      line.append(dot);
    }
    line.append(text);
    return line;
  }));
  tip.hidden = false;
  const box = tip.getBoundingClientRect();
  const left = event.clientX + 16 + box.width > innerWidth ? event.clientX - 16 - box.width : event.clientX + 16;
  tip.style.left = left + "px";
  tip.style.top = Math.max(8, Math.min(event.clientY - box.height / 2, innerHeight - box.height - 8)) + "px";
}

function colourOf(name, index) {
  if (name === "truth") return "var(--c-truth)";
  if (name === "body") return "var(--c-body)";
  if (name === "softtissue") return "var(--c-ours)";
  return `var(--c${index % 7})`;
}

function frame(host, title) {
  host.replaceChildren();
  const top = element("div", "top");
  top.append(element("b", "", title));
  host.append(top);
  return top;
}

// Lines over a common axis. options: title, x, y (labels), series [{name, label, colour, points, dashed}], log, zero, height,
// unit; `choose` {names, index, change} puts a chooser at the top; `hidden` is a set of names switched off.
function lineChart(host, options) {
  const top = frame(host, options.title || "");
  if (options.choose) {
    const select = element("select");
    select.setAttribute("aria-label", options.choose.label);
    options.choose.names.forEach((name, i) => select.add(new Option(name, i, false, i === options.choose.index)));
    select.addEventListener("change", () => options.choose.change(+select.value));
    top.append(select);
  }
  const hidden = options.hidden || new Set();
  const key = element("div", "key");
  for (const s of options.series) {
    const entry = element("button", hidden.has(s.name) ? "off" : "");
    entry.type = "button";
    const dash = element("i");
    dash.style.borderColor = s.colour;
    if (s.dashed) dash.style.borderStyle = "dashed";
    entry.append(dash, s.label);
    entry.addEventListener("click", () => {
      if (!hidden.delete(s.name)) hidden.add(s.name);
      lineChart(host, { ...options, hidden });
    });
    key.append(entry);
  }
  host.append(key);
  const shown = options.series.filter((s) => !hidden.has(s.name) && s.points.length);
  const [width, height] = [Math.max(300, Math.min(host.clientWidth || 900, 1200) - 32), options.height || 300];
  const pad = { left: 52, right: 12, top: options.y ? 26 : 12, bottom: options.x ? 38 : 24 };
  const svg = make("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": options.title || "" }, host);
  const all = shown.flatMap((s) => s.points);
  if (!all.length) return null;
  const value = options.log ? (y) => Math.log10(Math.max(y, 1e-12)) : (y) => y;
  let [x0, x1, y0, y1] = [Infinity, -Infinity, Infinity, -Infinity];
  for (const [x, y] of all) {
    x0 = Math.min(x0, x); x1 = Math.max(x1, x);
    y0 = Math.min(y0, value(y)); y1 = Math.max(y1, value(y));
  }
  if (options.zero) y0 = Math.min(0, y0);
  if (options.floor !== undefined) y0 = Math.max(y0, options.floor(y1));
  if (y1 - y0 < 1e-9) y1 = y0 + 1;
  y1 += (y1 - y0) * 0.05;
  const px = (x) => pad.left + ((x - x0) / (x1 - x0 || 1)) * (width - pad.left - pad.right);
  const py = (y) => height - pad.bottom - ((Math.max(value(y), y0) - y0) / (y1 - y0)) * (height - pad.top - pad.bottom);
  for (const t of options.log ? decades(y0, y1) : ticks(y0, y1, height / 55)) {
    const y = py(options.log ? 10 ** t : t);
    make("line", { class: "axis", x1: pad.left, x2: width - pad.right, y1: y, y2: y }, svg);
    make("text", { x: pad.left - 8, y: y + 4, "text-anchor": "end" }, svg).textContent = shortNumber(options.log ? 10 ** t : t);
  }
  for (const t of ticks(x0, x1, width / 90)) {
    make("text", { x: px(t), y: height - pad.bottom + 17, "text-anchor": "middle" }, svg).textContent = shortNumber(t);
  }
  make("line", { class: "base", x1: pad.left, x2: width - pad.right, y1: height - pad.bottom, y2: height - pad.bottom }, svg);
  if (options.x) make("text", { x: (width + pad.left) / 2, y: height - 4, "text-anchor": "middle" }, svg).textContent = options.x;
  if (options.y) make("text", { x: 0, y: 12 }, svg).textContent = options.y;
  for (const s of shown) {
    const d = s.points.map(([x, y], i) => (i ? "L" : "M") + px(x).toFixed(1) + " " + py(y).toFixed(1)).join("");
    const ours = s.name === "truth" || s.name === "softtissue";
    make("path", { d, fill: "none", style: `stroke:${s.colour}`, "stroke-width": ours ? 2.2 : 1.4, "stroke-linejoin": "round", "stroke-dasharray": s.dashed ? "6 4" : "none" }, svg);
  }
  const cursor = make("line", { class: "cursor", y1: pad.top, y2: height - pad.bottom, visibility: "hidden" }, svg);
  const place = (x) => {
    cursor.setAttribute("x1", px(x));
    cursor.setAttribute("x2", px(x));
    cursor.setAttribute("visibility", "visible");
  };
  const toX = (event) => {
    const box = svg.getBoundingClientRect();
    const at = ((event.clientX - box.left) / box.width) * width;
    return Math.min(x1, Math.max(x0, x0 + ((at - pad.left) / (width - pad.left - pad.right)) * (x1 - x0)));
  };
  svg.addEventListener("pointermove", (event) => {
    const x = toX(event);
    if (!options.seek) place(x);
    const rows = shown.map((s) => {
      const near = s.points.reduce((a, b) => (Math.abs(b[0] - x) < Math.abs(a[0] - x) ? b : a));
      return [s.colour, `${s.label}: ${shortNumber(near[1])} ${options.unit || ""}`, near[1]];
    });
    rows.sort((a, b) => b[2] - a[2]);
    showTip(event, [[null, `${shortNumber(x)} ${options.xUnit || ""}`], ...rows]);
  });
  svg.addEventListener("pointerleave", () => {
    tip.hidden = true;
    if (!options.seek) cursor.setAttribute("visibility", "hidden");
  });
  if (options.seek) svg.addEventListener("click", (event) => options.seek(toX(event)));
  return place;
}

// Horizontal bars. options: title, rows [{label, value, error, colour, strong}], limits [numbers], unit.
function barChart(host, options) {
  frame(host, options.title);
  const rows = options.rows.filter((r) => r.value !== null && r.value !== undefined);
  if (!rows.length) return;
  const [width, step] = [Math.max(300, Math.min(host.clientWidth || 560, 800) - 32), 30];
  const pad = { left: 158, right: 52, top: 6, bottom: 24 };
  const height = pad.top + pad.bottom + rows.length * step;
  const svg = make("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": options.title }, host);
  const limits = options.limits || [];
  const high = Math.max(...rows.map((r) => r.value), ...limits) * 1.04 || 1;
  const px = (x) => pad.left + (x / high) * (width - pad.left - pad.right);
  for (const t of ticks(0, high, 5)) {
    make("line", { class: "axis", x1: px(t), x2: px(t), y1: pad.top, y2: height - pad.bottom }, svg);
    make("text", { x: px(t), y: height - 8, "text-anchor": "middle" }, svg).textContent = shortNumber(t);
  }
  rows.forEach((r, i) => {
    const y = pad.top + i * step + 6;
    make("rect", { x: pad.left, y, width: Math.max(px(r.value) - pad.left, 1), height: step - 12, rx: 3, style: `fill:${r.colour}` }, svg);
    make("text", { x: pad.left - 10, y: y + 13, "text-anchor": "end", class: r.strong ? "strong" : "" }, svg).textContent = r.label;
    make("text", { x: px(r.value) + 7, y: y + 13, class: "strong" }, svg).textContent = r.value.toFixed(2);
  });
  for (const x of limits) make("line", { class: "limit", x1: px(x), x2: px(x), y1: pad.top, y2: height - pad.bottom }, svg);
}

// Upright bars in groups. options: title, y, groups [{label, bars: [{label, value, colour}]}].
function groupChart(host, options) {
  const top = frame(host, options.title);
  const key = element("div", "key");
  for (const b of options.groups[0].bars) {
    const entry = element("span");
    const dash = element("i");
    dash.style.cssText = `display:inline-block;vertical-align:middle;margin-right:.4em;border-color:${b.colour}`;
    entry.append(dash, b.label);
    key.append(entry);
  }
  top.append(key);
  const [width, height] = [Math.max(300, Math.min(host.clientWidth || 900, 1200) - 32), 260];
  const pad = { left: 52, right: 12, top: 28, bottom: 30 };
  const svg = make("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": options.title }, host);
  const high = Math.max(...options.groups.flatMap((g) => g.bars.map((b) => b.value || 0))) * 1.12 || 1;
  const py = (y) => height - pad.bottom - (y / high) * (height - pad.top - pad.bottom);
  for (const t of ticks(0, high, 5)) {
    make("line", { class: "axis", x1: pad.left, x2: width - pad.right, y1: py(t), y2: py(t) }, svg);
    make("text", { x: pad.left - 8, y: py(t) + 4, "text-anchor": "end" }, svg).textContent = shortNumber(t);
  }
  const slot = (width - pad.left - pad.right) / options.groups.length;
  options.groups.forEach((g, i) => {
    const each = Math.min(64, (slot * 0.7) / g.bars.length);
    const start = pad.left + slot * (i + 0.5) - (each * g.bars.length) / 2;
    g.bars.forEach((b, k) => {
      if (b.value === null || b.value === undefined) return;
      const x = start + k * each + 2;
      make("rect", { x, y: py(b.value), width: each - 4, height: py(0) - py(b.value), rx: 3, style: `fill:${b.colour};opacity:${b.faint ? 0.45 : 1}` }, svg);
      make("text", { x: x + each / 2 - 2, y: py(b.value) - 5, "text-anchor": "middle", class: "strong" }, svg).textContent = b.value.toFixed(2);
    });
    make("text", { x: pad.left + slot * (i + 0.5), y: height - 9, "text-anchor": "middle" }, svg).textContent = g.label;
  });
  if (options.y) make("text", { x: 0, y: 12 }, svg).textContent = options.y;
}
