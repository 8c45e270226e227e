// Puts the data into charts and the viewer.

(function () {
  const data = JSON.parse(document.getElementById("data").textContent);
  document.body.append(tip);
  const at = (id) => document.getElementById(id);
  const colours = {};
  data.methods.filter((m) => m !== "body" && m !== "softtissue").forEach((m, i) => (colours[m] = colourOf(m, i)));
  const colour = (name, i) => colours[name] || colourOf(name, i || 0);
  const label = (name) => data.labels[name] || name;
  const series = (curves) => curves.map(([name, points], i) => ({ name, label: label(name), colour: colour(name, i), points }));
  // PCA and the autoencoder of one size share a colour; PCA is dashed.
  const sizes = (curves) => curves.map(([name, points], i) => ({
    name, label: name, colour: `var(--c${(i >> 1) % 7})`, dashed: name.startsWith("PCA"), points,
  }));
  const strong = (name) => name === "softtissue";

  // The first view of many lines shows the ones that matter; the others are a click away.
  const asides = () => new Set(data.methods.filter((m) => m.includes("/") || ["mean", "ridge", "ar2-pooled"].includes(m)));
  // A chart with a chooser: draws entry `index` and keeps what was switched off.
  function chooser(id, entries, draw) {
    const host = at(id);
    if (!host || !entries.length) return () => {};
    const state = { index: 0, hidden: asides() };
    const redraw = () => lineChart(host, {
      ...draw(entries[state.index]),
      hidden: state.hidden,
      choose: { label: "Choose a chart", names: entries.map((e) => e.name || e.clip), index: state.index, change: (i) => { state.index = i; redraw(); } },
    });
    return redraw;
  }

  const drawTime = chooser("chart-time", data.over_time, (clip) => ({
    title: "Mean error", x: "seconds", xUnit: "s", y: "mm", unit: "mm", zero: true,
    series: series(clip.curves.map(([name, values]) => [name, values.map((y, t) => [t / clip.fps, y])])),
  }));
  const drawSpectra = chooser("chart-spectra", data.spectra, (region) => ({
    title: "Power over frequency, mean over clips", x: "hertz", xUnit: "Hz", y: "dB over 1 mm²/Hz", unit: "dB", floor: (top) => top - 50, series: series(region.curves),
  }));
  const drawDecay = chooser("chart-decay", data.decays, (region) => ({
    title: "Regional mean along its main axis", x: "seconds after landing", xUnit: "s", y: "mm", unit: "mm", series: series(region.curves),
  }));
  const drawTraining = chooser("chart-training", data.training, (stage) => ({
    title: stage.name, x: "step", y: "", log: stage.curves.every(([, c]) => c.every(([, y]) => y > 0)), series: series(stage.curves),
  }));

  function drawShapes() {
    if (at("chart-shapes")) lineChart(at("chart-shapes"), {
      title: "Mean vertex speed of the deltas", x: "beta 1 (heavier to the left)", y: "mm/s", unit: "mm/s", zero: true, series: series(data.shapes),
    });
  }

  const drawPeople = chooser("chart-people", data.people, (chart) => ({
    title: chart.name, x: "beta 1 (heavier to the left)", y: "", zero: true, series: series(chart.curves),
  }));
  const drawBmi = chooser("chart-bmi", data.bmi, (chart) => ({
    title: chart.name, x: "body mass index, kg/m²", xUnit: "kg/m²", y: "", zero: true, series: series(chart.curves),
  }));
  const drawSubspaceTime = chooser("chart-subspace-time", data.subspace_time, (clip) => ({
    title: "Mean error of all vertices", x: "seconds", xUnit: "s", y: "mm", unit: "mm", zero: true, series: sizes(clip.curves),
  }));

  function drawSubspacePeople() {
    if (at("chart-subspace-people")) lineChart(at("chart-subspace-people"), {
      title: "Mean error of all vertices by person", x: "beta 1 (heavier to the left)", y: "mm", unit: "mm", zero: true, series: sizes(data.subspace_people),
    });
  }

  function drawBars() {
    const row = (value) => (b) => ({ label: label(b.name), value: b[value], colour: colour(b.name), strong: strong(b.name) });
    if (at("chart-soft")) barChart(at("chart-soft"), { title: "Soft ratio: error over the body's own (less is better)", rows: data.bars.map(row("soft_ratio")) });
    if (at("chart-energy")) barChart(at("chart-energy"), { title: "Energy: speed over the true one (1 is right)", rows: data.bars.map(row("energy")), limits: [1] });
    if (at("chart-timing")) barChart(at("chart-timing"), {
      title: "Milliseconds a frame, one core (less is better)", rows: data.timing.map(([name, value]) => ({ label: label(name), value, colour: colour(name), strong: strong(name) })),
    });
    if (at("chart-subspace") && data.subspace.length) {
      const truth = data.subspace.some((s) => s.pca !== null);
      groupChart(at("chart-subspace"), {
        title: truth ? "Error against the true deltas" : "Error against the input", y: "mm",
        groups: data.subspace.map((s) => ({ label: s.latent + " numbers", bars: [
          { label: "PCA", value: truth ? s.pca : s.scan_pca, colour: "var(--c-body)" },
          { label: "autoencoder", value: truth ? s.ae : s.scan_ae, colour: "var(--c-ours)" }] })),
      });
    }
  }

  const player = data.view && new Player(data.view);

  function drawAll() {
    [drawTime, drawSpectra, drawShapes, drawPeople, drawBmi, drawSubspaceTime, drawSubspacePeople, drawDecay, drawTraining, drawBars].forEach((draw) => draw());
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
