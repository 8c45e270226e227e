// Puts the data of a method that predicts surfaces into charts and the viewer.

(function () {
  const data = pageData();
  const colour = (name, i) => colourOf(name, Math.max(data.rows.indexOf(name), i || 0));
  const series = (curves) => curves.map(([name, points], i) => ({ name, label: data.labels[name] || name, colour: colour(name, i), points }));

  const plain = (chart) => ({ title: chart.name, x: chart.x, xUnit: chart.x === "seconds" ? "s" : "", y: chart.unit, unit: chart.unit, zero: true, series: series(chart.curves) });
  const charts = (id, entries, draw) => chooser(id, entries, [], draw);
  runPage([
    charts("chart-rollouts", data.rollouts, plain),
    charts("chart-time", data.time, plain),
    charts("chart-training", data.training, (stage) => ({
      title: stage.name, x: stage.x, y: "", log: stage.curves.every(([, c]) => c.every(([, y]) => y > 0)), series: series(stage.curves),
    })),
  ], data.view);
})();
