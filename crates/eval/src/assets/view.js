// Starts the viewer of a page that has nothing else.

(function () {
  const at = (id) => document.getElementById(id);
  document.body.append(tip);
  const player = new Player(JSON.parse(at("data").textContent));
  player.start().catch((error) => {
    at("viewer").hidden = true;
    at("viewer-missing").hidden = false;
    at("viewer-missing").textContent = `The 3D view cannot be shown: ${error.message}.`;
  });
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; player.chart(); } });
  const root = document.documentElement;
  at("theme").addEventListener("click", () => {
    const dark = root.dataset.theme ? root.dataset.theme === "dark" : matchMedia("(prefers-color-scheme: dark)").matches;
    root.dataset.theme = dark ? "light" : "dark";
    player.show(player.frame);
  });
})();
