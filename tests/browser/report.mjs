// Opens a report in headless Chromium, as a person would: moves the time slider, plays, turns, switches.
// usage: node report.mjs REPORT.html FOLDER_WITH_NODE_MODULES [CHROMIUM]
import assert from "node:assert/strict";
import { createRequire } from "node:module";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const [report, modules, executablePath = "/usr/bin/chromium"] = process.argv.slice(2);
const { chromium } = createRequire(resolve(modules) + "/")("playwright-core");
const address = pathToFileURL(resolve(report)).href;
const softwareGl = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];

async function open(args, options = {}) {
  const browser = await chromium.launch({ executablePath, args });
  const page = await browser.newPage({ viewport: { width: 1280, height: 900 }, reducedMotion: "reduce", ...options });
  const complaints = [];
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && !/GPU stall|swiftshader|GL Driver/i.test(m.text()) && complaints.push(m.text()));
  page.on("pageerror", (e) => complaints.push(String(e)));
  page.on("request", (r) => r.url() !== address && !/^(data|blob):/.test(r.url()) && complaints.push("it asked for " + r.url()));
  await page.goto(address);
  return { browser, page, complaints };
}

const NAMES = ["reference", "alone", "predicted"];

// Pixels of the three canvases, kept in the page under a name.
const grab = (page, name) => page.evaluate(([name, names]) => {
  window.grabbed ??= {};
  window.grabbed[name] = names.map((n) => {
    const canvas = document.getElementById("view-" + n), copy = document.createElement("canvas");
    copy.width = canvas.width; copy.height = canvas.height;
    const context = copy.getContext("2d");
    context.drawImage(canvas, 0, 0);
    return context.getImageData(0, 0, copy.width, copy.height).data;
  });
}, [name, NAMES]);

// Share of pixels that differ visibly (by more than 8 of 255 in some channel).
const differing = (page, [a, i], [b, k]) => page.evaluate(([a, i, b, k]) => {
  const [x, y] = [window.grabbed[a][i], window.grabbed[b][k]];
  if (x.length !== y.length) return 1;
  let count = 0;
  for (let p = 0; p < x.length; p += 4) count += [0, 1, 2, 3].some((c) => Math.abs(x[p + c] - y[p + c]) > 8);
  return count / (x.length / 4);
}, [a, i, b, k]);

const drawn = (page, name) => page.evaluate((name) => window.grabbed[name].map((d) => {
  let count = 0;
  for (let p = 3; p < d.length; p += 4) count += d[p] > 0;
  return count / (d.length / 4);
}), name);

async function seek(page, share) {
  const last = +(await page.locator("#time").getAttribute("max"));
  await page.locator("#time").fill(String(Math.round(last * share)));
  await page.waitForTimeout(50);
}

const tests = {
  "the time slider changes three canvases, each unlike the others": async (page) => {
    // Late enough for short clips, which begin by leaving the A-pose.
    const moments = [0.5, 0.75, 0.95];
    for (const [n, share] of moments.entries()) {
      await seek(page, share);
      await grab(page, "t" + n);
      for (const share of await drawn(page, "t" + n)) assert(share > 0.03, `a figure covers more than ${share} of its view`);
      for (const [i, k] of [[0, 1], [0, 2], [1, 2]]) {
        const d = await differing(page, ["t" + n, i], ["t" + n, k]);
        assert(d > 0.001, `${NAMES[i]} and ${NAMES[k]} look the same at ${share}: ${d}`);
      }
    }
    for (const i of [0, 1, 2]) {
      for (const [a, b] of [["t0", "t1"], ["t1", "t2"]]) {
        const d = await differing(page, [a, i], [b, i]);
        assert(d > 0.002, `${NAMES[i]} does not move from ${a} to ${b}: ${d}`);
      }
    }
    await seek(page, moments[0]);
    await grab(page, "again");
    for (const i of [0, 1, 2]) assert.equal(await differing(page, ["t0", i], ["again", i]), 0, "the same time looks the same");
  },
  "it plays, pauses and shows the time": async (page) => {
    await seek(page, 0);
    const before = await page.locator("#clock").textContent();
    await page.click("#play");
    await page.waitForFunction((t) => document.getElementById("clock").textContent !== t, before);
    await page.click("#play");
    const paused = await page.locator("#clock").textContent();
    await page.waitForTimeout(200);
    assert.equal(await page.locator("#clock").textContent(), paused);
  },
  "dragging one view turns all three": async (page) => {
    await seek(page, 0.3);
    await grab(page, "front");
    const box = await page.locator("#view-alone").boundingBox();
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 2 + 120, box.y + box.height / 2, { steps: 6 });
    await page.mouse.up();
    await grab(page, "turned");
    for (const i of [0, 1, 2]) assert((await differing(page, ["front", i], ["turned", i])) > 0.02, NAMES[i]);
    await page.click("#reset");
    await grab(page, "reset");
    for (const i of [0, 1, 2]) assert.equal(await differing(page, ["front", i], ["reset", i]), 0);
  },
  "colour and exaggeration change what they should": async (page) => {
    await seek(page, 0.95);
    await grab(page, "error");
    await page.selectOption("#colour", "displacement");
    await grab(page, "displacement");
    for (const i of [0, 1]) assert((await differing(page, ["error", i], ["displacement", i])) > 0.005, NAMES[i]);
    await page.locator("#gain").fill("4");
    await grab(page, "exaggerated");
    assert.equal(await differing(page, ["displacement", 1], ["exaggerated", 1]), 0, "the body alone has nothing to exaggerate");
    for (const i of [0, 2]) assert((await differing(page, ["displacement", i], ["exaggerated", i])) > 0.002, NAMES[i]);
    await page.locator("#gain").fill("1");
    await page.selectOption("#colour", "error");
  },
  "another clip can be chosen": async (page) => {
    const clips = await page.locator("#clip option").count();
    if (clips < 2) return;
    await seek(page, 0.45);
    await grab(page, "first");
    await page.selectOption("#clip", "1");
    await page.waitForTimeout(600);
    await grab(page, "second");
    for (const i of [0, 1, 2]) assert((await differing(page, ["first", i], ["second", i])) > 0.002, NAMES[i]);
    await page.selectOption("#clip", "0");
  },
  "figures stand in tables and charts": async (page) => {
    assert((await page.locator(".card").count()) >= 3);
    const gates = await page.locator("#gates tbody tr").count();
    assert(gates > 5 && (await page.locator("#gates .chip").count()) === gates);
    assert((await page.locator("#errors table").first().locator("tbody tr").count()) >= 2);
    for (const id of ["chart-soft", "chart-energy", "chart-time", "chart-spectra"]) {
      assert((await page.locator(`#${id} svg :is(path, rect)`).count()) > 0, id);
    }
    for (const chart of await page.locator("main .chart:visible").all()) {
      assert((await chart.locator("svg :is(path, rect)").count()) > 0, `${await chart.getAttribute("id")} is empty`);
    }
    const text = await page.locator("main").innerText();
    assert(!/NaN|undefined|Infinity|null/.test(text), "no word of the machine's in the text");
    await page.locator("#chart-time svg").hover();
    assert(await page.locator(".tip").isVisible());
    const lines = await page.locator("#chart-time path").count();
    await page.locator("#chart-time .key button").first().click();
    assert.equal(await page.locator("#chart-time path").count(), lines - 1, "a line can be switched off");
  },
  "it can be light or dark": async (page) => {
    const paper = () => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    const light = await paper();
    await page.click("#theme");
    assert.notEqual(await paper(), light);
    await page.click("#theme");
    assert.equal(await paper(), light);
  },
  "it fits a telephone": async (page) => {
    await page.setViewportSize({ width: 390, height: 800 });
    await page.waitForTimeout(200);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    assert(wide <= 390, `the page is ${wide} wide`);
    await page.setViewportSize({ width: 1280, height: 900 });
  },
};

let [passed, failed] = [0, 0];
async function check(name, act) {
  try {
    await act();
    passed++;
    console.log(`ok   ${name}`);
  } catch (error) {
    failed++;
    console.log(`FAIL ${name}\n     ${String(error.message).split("\n").join("\n     ")}`);
  }
}

{
  const { browser, page, complaints } = await open(softwareGl);
  await page.waitForFunction(() => document.querySelector("#viewer .readout")?.textContent || !document.getElementById("viewer-missing").hidden);
  for (const name in tests) await check(name, () => tests[name](page));
  await check("nothing was loaded and nothing complained", () => assert.deepEqual(complaints, []));
  await browser.close();
}
{
  const { browser, page } = await open(["--no-sandbox", "--disable-3d-apis"]);
  await check("without WebGL a sentence says so and the rest stands", async () => {
    await page.locator("#viewer-missing").waitFor({ state: "visible" });
    assert.match(await page.locator("#viewer-missing").innerText(), /cannot be shown: .*WebGL/);
    assert((await page.locator("#chart-soft svg rect").count()) > 0);
  });
  await browser.close();
}
console.log(`${passed} passed, ${failed} failed`);
process.exitCode = failed ? 1 : 0;
