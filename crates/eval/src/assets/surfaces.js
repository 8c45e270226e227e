// Puts the data of a method that predicts surfaces into charts and the viewer.

(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  document.body.append(tip);
  const at = (id) => document.getElementById(id);
  const colour = (name, i) => colourOf(name, Math.max(data.rows.indexOf(name), i || 0));
  const series = (curves) => curves.map(([name, points], i) => ({ name, label: data.labels[name] || name, colour: colour(name, i), points }));

  // A chart with a chooser: draws entry `index` and keeps what was switched off.
  function chooser(id, entries, draw) {
    const host = at(id);
    if (!host || !entries.length) return () => {};
    const state = { index: 0, hidden: new Set() };
    const redraw = () => lineChart(host, {
      ...draw(entries[state.index]),
      hidden: state.hidden,
      choose: { label: "Choose a chart", names: entries.map((e) => e.name), index: state.index, change: (i) => { state.index = i; redraw(); } },
    });
    return redraw;
  }
  const plain = (chart) => ({ title: chart.name, x: chart.x, xUnit: chart.x === "seconds" ? "s" : "", y: chart.unit, unit: chart.unit, zero: true, series: series(chart.curves) });
  const drawRollouts = chooser("chart-rollouts", data.rollouts, plain);
  const drawTime = chooser("chart-time", data.time, plain);
  const drawTraining = chooser("chart-training", data.training, (stage) => ({
    title: stage.name, x: stage.x, y: "", log: stage.curves.every(([, c]) => c.every(([, y]) => y > 0)), series: series(stage.curves),
  }));

  const player = data.view && new Player(data.view);
  function drawAll() {
    [drawRollouts, drawTime, drawTraining].forEach((draw) => draw());
    if (player) player.chart();
  }
  drawAll();
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; drawAll(); } });
  if (player) player.start().catch((error) => {
    at("viewer").hidden = true;
    at("viewer-missing").hidden = false;
    at("viewer-missing").textContent = `The 3D view cannot be shown: ${error.message}. Everything else on this page works without it.`;
  });
  const root = document.documentElement;
  at("theme").addEventListener("click", () => {
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    if (player) player.show(player.frame);
  });
})();
