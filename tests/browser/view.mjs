// Opens a page of `softtissue view` in headless Chromium and uses it: panes, colours, regions, curve.
// usage: node view.mjs PAGE.html FOLDER_WITH_NODE_MODULES CHROMIUM [FOLDER_FOR_PICTURES]
import assert from "node:assert/strict";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [file, modules, executablePath, pictures] = process.argv.slice(2);
const { chromium } = createRequire(resolve(modules) + "/")("playwright-core");
const address = pathToFileURL(resolve(file)).href;
const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];

const browser = await chromium.launch({ executablePath, args });
const page = await browser.newPage({ viewport: { width: 1280, height: 900 }, reducedMotion: "reduce" });
const complaints = [];
page.on("console", (m) => ["error", "warning"].includes(m.type()) && !/GPU stall|swiftshader|GL Driver/i.test(m.text()) && complaints.push(m.text()));
page.on("pageerror", (e) => complaints.push(String(e)));
page.on("request", (r) => r.url() !== address && !/^(data|blob):/.test(r.url()) && complaints.push("it asked for " + r.url()));
await page.goto(address);
// a canvas that nothing was drawn on has 300 by 150 pixels
await page.waitForFunction(() => [...document.querySelectorAll("canvas")].every((c) => c.height !== 150));
await page.waitForTimeout(300);

// A short name for what each canvas shows.
const seen = () => page.evaluate(() => [...document.querySelectorAll("#viewer canvas")].map((c) => {
  const copy = document.createElement("canvas");
  [copy.width, copy.height] = [c.width, c.height];
  const context = copy.getContext("2d");
  context.drawImage(c, 0, 0);
  const { data } = context.getImageData(0, 0, copy.width, copy.height);
  let [hash, drawn] = [0, 0];
  for (let i = 0; i < data.length; i += 4) {
    hash = (Math.imul(hash, 31) + data[i] + 256 * data[i + 1] + 65536 * data[i + 2]) | 0;
    drawn += data[i + 3] > 0;
  }
  return { hash, share: drawn / (data.length / 4) };
}));
const changed = (a, b) => a.map((x, i) => x.hash !== b[i].hash);
const readouts = () => page.locator("#viewer .readout").allTextContents();
const picture = (name) => pictures && page.screenshot({ path: join(pictures, name + ".png"), fullPage: true });
async function seek(share) {
  const last = +(await page.locator("#time").getAttribute("max"));
  await page.locator("#time").fill(String(Math.round(last * share)));
}

const panes = await page.locator("#viewer figure").count();
const layers = await page.locator("#viewer figure").first().locator("option").count();
const tests = {
  "every pane shows a body that moves": async () => {
    await seek(0.5);
    const before = await seen();
    for (const { share } of before) assert(share > 0.03, `a figure covers more than ${share}`);
    await seek(0.9);
    assert(changed(before, await seen()).every(Boolean), "not all panes move");
    await picture("light");
  },
  "a pane shows what is chosen for it, and the others stay": async () => {
    const before = await seen();
    const chooser = page.locator("#viewer figure select").first();
    const old = await chooser.inputValue();
    await chooser.selectOption(String((+old + 1) % layers));
    const after = changed(before, await seen());
    assert.deepEqual(after, after.map((_, i) => i === 0));
    await chooser.selectOption(old);
    assert(changed(before, await seen()).every((c) => !c), "choosing back shows the same");
  },
  "colours, regions and scale change what is drawn and said": async () => {
    await page.selectOption("#colour", "displacement");
    const [drawn, said, title] = [await seen(), await readouts(), await page.locator("#chart-play b").textContent()];
    assert.match(title, /^Mean displacement, soft parts, mm$/);
    assert(await page.locator("#against").isDisabled());
    assert(said.some((r) => /^\d+\.\d mm from /.test(r)), said.join("; "));
    await page.selectOption("#region", "belly");
    assert.notDeepEqual(await readouts(), said);
    assert(changed(drawn, await seen()).some(Boolean), "the other regions lose their colour");
    assert.match(await page.locator("#chart-play b").textContent(), /belly/);
    await page.selectOption("#region", "soft");
    await page.selectOption("#scale", "100");
    assert.equal(await page.locator("#legend-high").textContent(), "100 mm");
    await page.selectOption("#scale", "");
    assert(changed(drawn, await seen()).every((c) => !c));
    await page.selectOption("#colour", "plain");
    assert(!(await page.locator("#legend-ramp").isVisible()));
    await page.selectOption("#colour", "error");
  },
  "distances are measured from any layer": async () => {
    const chosen = await page.locator("#against").inputValue();
    const titles = new Set();
    for (let l = 0; l < layers; l++) {
      await page.selectOption("#against", String(l));
      titles.add(await page.locator("#chart-play b").textContent());
      for (const said of await readouts()) assert(/^\d+\.\d mm from |^$/.test(said), said);
    }
    assert.equal(titles.size, layers);
    await page.selectOption("#against", chosen);
  },
  "dragging turns all panes, with Shift it moves them": async () => {
    for (const key of [null, "Shift"]) {
      // the click on the button below may have scrolled, and slowly
      await page.evaluate(() => scrollTo({ top: 0, behavior: "instant" }));
      await page.waitForTimeout(100);
      const before = await seen();
      const box = await page.locator("#viewer canvas").last().boundingBox();
      const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
      if (key) await page.keyboard.down(key);
      await page.mouse.move(x, y);
      await page.mouse.down();
      await page.mouse.move(x + 60, y + 20, { steps: 4 });
      await page.mouse.up();
      if (key) await page.keyboard.up(key);
      await page.waitForTimeout(100);
      assert(changed(before, await seen()).every(Boolean), key ?? "drag");
      await page.click("#reset");
    }
  },
  "it plays with the space key": async () => {
    await page.evaluate(() => document.activeElement.blur());
    const before = await page.locator("#clock").textContent();
    await page.keyboard.press("Space");
    await page.waitForFunction((t) => document.getElementById("clock").textContent !== t, before);
    await page.keyboard.press("Space");
  },
  "it can be dark, and fits a telephone": async () => {
    const before = await seen();
    await page.click("#theme");
    assert(changed(before, await seen()).every(Boolean), "the floor's lines have another colour");
    await picture("dark");
    await page.setViewportSize({ width: 390, height: 800 });
    await page.waitForTimeout(200);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    assert(wide <= 390, `the page is ${wide} wide`);
    await picture("telephone");
  },
  "nothing was loaded and nothing complained": async () => assert.deepEqual(complaints, []),
};

let [passed, failed] = [0, 0];
for (const name in tests) {
  try {
    await tests[name]();
    passed++;
    console.log(`ok   ${name}`);
  } catch (error) {
    failed++;
    console.log(`FAIL ${name}\n     ${String(error.message).split("\n").join("\n     ")}`);
  }
}
await browser.close();
console.log(`${panes} panes: ${passed} passed, ${failed} failed`);
process.exitCode = failed ? 1 : 0;
