// The sliders: shape, gain and softness, and what they say of the person.

// Softness multiplies: everywhere times region stays within what the player takes, 1/4 to 4.
const SOFTEST = 2, MOST_GAIN = 3, SHAPE_REACH = 3, SHAPES = 6;

const affine = (map, beta) => beta.reduce((sum, b, i) => sum + b * (map[i + 1] || 0), map[0]);

export class Panel {
  // `shapes` coefficients; `changed` is called after any of them moved.
  constructor(facts, shapes, changed) {
    this.facts = facts;
    this.changed = changed;
    this.sliders = [];
    this.beta = new Array(shapes).fill(0);
    this.gain = { everywhere: 1 };
    this.softness = { everywhere: 1 };
    this.addShapes(Math.min(shapes, SHAPES));
    const times = (x) => "× " + x.toFixed(2);
    this.slider("gains", { name: "Gain", id: "gain", low: 0, high: MOST_GAIN, start: 1, says: times, set: (x) => { this.gain.everywhere = x; } });
    const regions = facts.regions.filter((r) => r.soft).map((r) => r.name);
    for (const name of ["everywhere", ...regions]) {
      const reach = Math.log2(SOFTEST);
      this.slider("softness", { name: name.replace("-", " "), id: "softness-" + name, low: -reach, high: reach, start: 0, says: (x) => times(2 ** x), set: (x) => { this.softness[name] = 2 ** x; } });
    }
    document.getElementById("restore").addEventListener("click", () => this.restore());
    this.say();
  }
  // Body mass and height get their names from what the coefficients do; to the right is heavier and taller.
  addShapes(count) {
    const { rooted_weight: w, height: h } = this.facts;
    const heavier = (i) => (3 * (w[i + 1] || 0)) / w[0] - (2 * (h[i + 1] || 0)) / h[0], taller = (i) => h[i + 1] || 0;
    const all = Array.from({ length: count }, (_, i) => i);
    const most = (of, among) => among.reduce((best, i) => (best < 0 || Math.abs(of(i)) > Math.abs(of(best)) ? i : best), -1);
    this.mass = most(heavier, all);
    const tall = most(taller, all.filter((i) => i !== this.mass));
    const order = [this.mass, tall, ...all.filter((i) => i !== this.mass && i !== tall)].filter((i) => i >= 0);
    for (const i of order) {
      const way = (i === this.mass ? heavier(i) : i === tall ? taller(i) : 1) < 0 ? -1 : 1;
      const name = i === this.mass ? `Body mass β${i}` : i === tall ? `Height β${i}` : `Shape β${i}`;
      const says = (x) => (way * x).toFixed(1).replace("-", "−");
      this.slider("shapes", { name, id: "shape-" + i, low: -SHAPE_REACH, high: SHAPE_REACH, start: 0, says, set: (x) => { this.beta[i] = way * x; } });
    }
  }
  slider(host, { name, id, low, high, start, says, set }) {
    const row = document.createElement("label"), text = document.createElement("span"), input = document.createElement("input"), output = document.createElement("output");
    row.className = "slider";
    text.textContent = text.title = name[0].toUpperCase() + name.slice(1);
    Object.assign(input, { type: "range", id, min: low, max: high, step: 0.05, value: start });
    const take = () => {
      const x = +input.value;
      set(x);
      output.textContent = says(x);
      row.classList.toggle("changed", x !== start);
    };
    input.addEventListener("input", () => { take(); this.say(); this.changed(); });
    input.addEventListener("dblclick", () => { input.value = start; take(); this.say(); this.changed(); });
    row.append(text, input, output);
    document.getElementById(host).append(row);
    this.sliders.push(() => { input.value = start; take(); });
    take();
  }
  restore() {
    this.sliders.forEach((restore) => restore());
    this.say();
    this.changed();
  }
  // Who this is, and whether anybody like this was learned from.
  say() {
    const { rooted_weight: w, height: h, trained } = this.facts;
    const kilograms = affine(w, this.beta) ** 3, metres = affine(h, this.beta);
    document.getElementById("person").textContent = `${kilograms.toFixed(0)} kg, ${metres.toFixed(2)} m, BMI ${(kilograms / metres ** 2).toFixed(1)}`;
    const known = trained.find(([i]) => i === this.mass), mass = this.beta[this.mass];
    const outside = known && mass !== 0 && (mass < known[1] || mass > known[2]);
    const side = outside && `Beyond the people that the model learned from (β${this.mass} of ${known[1].toFixed(1)} to ${known[2].toFixed(1)}).`;
    document.getElementById("beyond").textContent = outside ? side.replaceAll("-", "−") : "";
  }
  // What is not as learned, for a player.
  controls() {
    const regions = Object.keys(this.softness).filter((r) => this.softness[r] !== 1 || (r === "everywhere" && this.gain.everywhere !== 1));
    return regions.map((r) => [r, r === "everywhere" ? this.gain.everywhere : 1, this.softness[r]]);
  }
}
