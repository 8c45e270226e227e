// Puts the data into charts and the viewer.

(function () {
  const data = pageData();
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
  const asides = data.methods.filter((m) => m.includes("/") || ["mean", "ridge", "ar2-pooled"].includes(m));
  const lines = (id, entries, draw) => chooser(id, entries, asides, draw);

  const drawTime = lines("chart-time", data.over_time, (clip) => ({
    title: "Mean error", x: "seconds", xUnit: "s", y: "mm", unit: "mm", zero: true,
    series: series(clip.curves.map(([name, values]) => [name, values.map((y, t) => [t / clip.fps, y])])),
  }));
  const drawSpectra = lines("chart-spectra", data.spectra, (region) => ({
    title: "Power over frequency, mean over clips", x: "hertz", xUnit: "Hz", y: "dB over 1 mm²/Hz", unit: "dB", floor: (top) => top - 50, series: series(region.curves),
  }));
  const drawDecay = lines("chart-decay", data.decays, (region) => ({
    title: "Regional mean along its main axis", x: "seconds after landing", xUnit: "s", y: "mm", unit: "mm", series: series(region.curves),
  }));
  const drawTraining = lines("chart-training", data.training, (stage) => ({
    title: stage.name, x: "step", y: "", log: stage.curves.every(([, c]) => c.every(([, y]) => y > 0)), series: series(stage.curves),
  }));

  function drawShapes() {
    if (at("chart-shapes")) lineChart(at("chart-shapes"), {
      title: "Mean vertex speed of the deltas", x: "beta 1 (heavier to the left)", y: "mm/s", unit: "mm/s", zero: true, series: series(data.shapes),
    });
  }

  const drawPeople = lines("chart-people", data.people, (chart) => ({
    title: chart.name, x: "beta 1 (heavier to the left)", y: "", zero: true, series: series(chart.curves),
  }));
  const drawBmi = lines("chart-bmi", data.bmi, (chart) => ({
    title: chart.name, x: "body mass index, kg/m²", xUnit: "kg/m²", y: "", zero: true, series: series(chart.curves),
  }));
  const drawSubspaceTime = lines("chart-subspace-time", data.subspace_time, (clip) => ({
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

  runPage([
    drawTime, drawSpectra, drawShapes, drawPeople, drawBmi, drawSubspaceTime, drawSubspacePeople, drawDecay, drawTraining, drawBars,
  ], data.view);
})();
