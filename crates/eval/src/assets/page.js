// What every page does: finds its data, starts the viewer, draws again when its width or theme changes.

const at = (id) => document.getElementById(id);
const pageData = () => JSON.parse(at("data").textContent);

// A chart with a chooser: draws the chosen entry and keeps which series were switched off, `hidden` at first.
function chooser(id, entries, hidden, draw) {
  const host = at(id);
  if (!host || !entries.length) return () => {};
  const state = { index: 0, hidden: new Set(hidden) };
  const redraw = () => lineChart(host, {
    ...draw(entries[state.index]),
    hidden: state.hidden,
    choose: { label: "Choose a chart", names: entries.map((e) => e.name || e.clip), index: state.index, change: (i) => { state.index = i; redraw(); } },
  });
  return redraw;
}

// Runs a page of charts, each drawn by one of `draws`, and a viewer of `view` where there is one.
function runPage(draws, view) {
  document.body.append(tip);
  const player = view && new Player(view);
  const drawAll = () => {
    draws.forEach((draw) => draw());
    if (player) player.chart();
  };
  drawAll();
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; drawAll(); } });
  if (player) player.start().catch((error) => {
    at("viewer").hidden = true;
    at("viewer-missing").hidden = false;
    const rest = draws.length ? " Everything else on this page works without it." : "";
    at("viewer-missing").textContent = `The 3D view cannot be shown: ${error.message}.${rest}`;
  });
  const root = document.documentElement;
  at("theme").addEventListener("click", () => {
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    if (player) player.show(player.frame);
  });
}
