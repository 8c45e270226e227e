// Opens the page of a bundle in headless Chromium: as `softtissue view` serves it, and as `softtissue export --web` wrote
// it, under a path of somebody's server. Uses it as a person would and measures what the player takes for a frame.
// usage: node page.mjs ADDRESS_OF_VIEW FOLDER MOTION.bvh FOLDER_WITH_NODE_MODULES [CHROMIUM] [FOLDER_FOR_PICTURES]
import assert from "node:assert/strict";
import { createServer } from "node:http";
import { createRequire } from "node:module";
import { readFile } from "node:fs/promises";
import { join, normalize, resolve } from "node:path";

const [view, folder, bvh, modules, executablePath = "/usr/bin/chromium", pictures] = process.argv.slice(2);
const { chromium } = createRequire(resolve(modules) + "/")("playwright-core");
const args = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"];
// Software drawing on a busy machine takes its time.
const PATIENCE = { timeout: 120_000 };

// A server that knows nothing of WebAssembly or of us, with the folder deep inside.
const BELOW = "/some/where/";
const plain = createServer(async (request, response) => {
  const path = new URL(request.url, "http://x").pathname;
  try {
    if (!path.startsWith(BELOW)) throw new Error("outside");
    const name = normalize(path.slice(BELOW.length) || "index.html");
    const type = name.endsWith(".js") ? "text/javascript" : name.endsWith(".html") ? "text/html" : name.endsWith(".css") ? "text/css" : "application/octet-stream";
    const bytes = await readFile(join(folder, name));
    response.writeHead(200, { "Content-Type": type }).end(bytes);
  } catch {
    response.writeHead(404).end();
  }
});
await new Promise((done) => plain.listen(0, "127.0.0.1", done));
const hosted = `http://127.0.0.1:${plain.address().port}${BELOW}`;

async function open(browser, address, options = {}) {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 }, reducedMotion: "reduce", ...options });
  const complaints = [];
  page.on("console", (m) => ["error", "warning"].includes(m.type()) && !/GPU stall|swiftshader|GL Driver/i.test(m.text()) && complaints.push(m.text()));
  page.on("pageerror", (e) => complaints.push(String(e)));
  page.on("request", (r) => !r.url().startsWith(address) && !/^(data|blob):/.test(r.url()) && complaints.push("it asked for " + r.url()));
  await page.goto(address);
  await page.waitForFunction(() => document.documentElement.dataset.ready || document.querySelector(".notice.bad"), undefined, PATIENCE);
  assert.equal(await page.locator(".notice.bad").count(), 0, await page.locator("#notice-text").textContent());
  return { page, complaints };
}

// Lets the page draw what was asked of it.
const settle = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => requestAnimationFrame(done)))));

const pixels = (page, name) => page.evaluate((name) => {
  const canvas = document.getElementById("view"), copy = document.createElement("canvas");
  copy.width = canvas.width; copy.height = canvas.height;
  const context = copy.getContext("2d");
  context.drawImage(canvas, 0, 0);
  (window.grabbed ??= {})[name] = context.getImageData(0, 0, copy.width, copy.height).data;
}, name);

// Share of pixels of the left (0) or right (1) half that differ by more than 8 of 255 in some channel.
const differing = (page, a, b, half) => page.evaluate(([a, b, half]) => {
  const [x, y] = [window.grabbed[a], window.grabbed[b]], { width } = document.getElementById("view");
  if (x.length !== y.length) return 1;
  let [count, all] = [0, 0];
  for (let p = 0; p < x.length; p += 4) {
    if (Math.floor(((p / 4) % width) / (width / 2)) !== half) continue;
    all++;
    count += [0, 1, 2].some((c) => Math.abs(x[p + c] - y[p + c]) > 8);
  }
  return count / all;
}, [a, b, half]);

// Vertices now: with soft tissue, without; whether all are finite, and how far the two are apart at most, millimetres.
const keep = (page, name) => page.evaluate((name) => {
  const { player } = window.softtissue.page;
  const [soft, alone] = [player.soft().slice(), player.alone().slice()];
  (window.kept ??= {})[name] = { soft, alone };
  let apart = 0;
  for (let i = 0; i < soft.length; i += 3) apart = Math.max(apart, Math.hypot(soft[i] - alone[i], soft[i + 1] - alone[i + 1], soft[i + 2] - alone[i + 2]));
  return { finite: soft.every(Number.isFinite) && alone.every(Number.isFinite), apart: 1000 * apart };
}, name);
const moved = (page, a, b, which) => page.evaluate(([a, b, which]) => {
  const [x, y] = [window.kept[a][which], window.kept[b][which]];
  return 1000 * x.reduce((most, v, i) => Math.max(most, Math.abs(v - y[i])), 0);
}, [a, b, which]);

async function set(page, id, value) {
  await page.locator("#" + id).fill(String(value));
  await settle(page);
}
async function seek(page, share) {
  await set(page, "time", +(await page.locator("#time").getAttribute("max")) * share);
}

const tests = {
  "it moves by itself, and stands still when it is told to": async (page) => {
    await seek(page, 0.2);
    await pixels(page, "before");
    await page.click("#play");
    const arrived = () => { const { time, motion, times } = window.softtissue.page; return time > 0.4 * motion.seconds && times.player.kept.length > 5; };
    await page.waitForFunction(arrived, undefined, PATIENCE);
    await page.click("#play");
    await settle(page);
    await pixels(page, "after");
    for (const half of [0, 1]) assert((await differing(page, "before", "after", half)) > 0.003, `half ${half} does not move`);
    assert.match(await page.locator("#figures").textContent(), /^Trust [01]\.\d\d · player \d+\.\d\d ms a frame, 95 % under \d/);
    const clock = await page.locator("#clock").textContent();
    await page.waitForTimeout(200);
    assert.equal(await page.locator("#clock").textContent(), clock);
  },
  "soft tissue moves the body, and the body alone is without it": async (page) => {
    await seek(page, 0.6);
    const { finite, apart } = await keep(page, "learned");
    assert(finite);
    assert(apart > 1, `soft tissue moves no vertex by a millimetre: ${apart} mm`);
    await set(page, "gain", 3);
    await pixels(page, "coloured");
    await page.uncheck("#colours");
    await settle(page);
    await pixels(page, "plain");
    assert.equal(await differing(page, "coloured", "plain", 0), 0, "the body alone has no colours");
    assert((await differing(page, "coloured", "plain", 1)) > 0.002, "displacements are not coloured");
    await page.check("#colours");
    await page.click("#restore");
    await settle(page);
  },
  "gain nought is the body alone, and gain two moves it farther": async (page) => {
    await seek(page, 0.6);
    const { apart } = await keep(page, "learned");
    await set(page, "gain", 0);
    assert((await keep(page, "none")).apart < 1e-3);
    await set(page, "gain", 2);
    const twice = (await keep(page, "twice")).apart;
    assert(Math.abs(twice / apart - 2) < 0.02, `${twice} mm is not twice ${apart} mm`);
    assert((await moved(page, "none", "twice", "alone")) < 1e-3, "the body alone stays as it is");
    await page.click("#restore");
    await settle(page);
    assert((await keep(page, "restored")).finite);
    assert((await moved(page, "learned", "restored", "soft")) < 1e-3, "what is restored is as learned");
  },
  "every slider of shape and softness changes the vertices": async (page) => {
    await seek(page, 0.6);
    await keep(page, "learned");
    const ids = await page.locator("#shapes input, #softness input").evaluateAll((all) => all.map((input) => input.id));
    assert(ids.filter((id) => id.startsWith("shape-")).length >= 2 && ids.includes("softness-everywhere") && ids.includes("softness-belly"), ids.join());
    for (const id of ids) {
      await set(page, id, id.startsWith("shape-") ? 2 : 1);
      assert((await keep(page, id)).finite, id);
      const [soft, alone] = [await moved(page, "learned", id, "soft"), await moved(page, "learned", id, "alone")];
      assert(soft > 0.01, `${id} changes nothing: ${soft} mm`);
      if (id.startsWith("softness-")) assert(alone < 1e-3, `${id} moves the body alone by ${alone} mm`);
      else assert(alone > 1, `${id} leaves the body alone as it is`);
      await page.click("#restore");
      await settle(page);
    }
    await set(page, ids[0], 2);
    const heavy = parseFloat(await page.locator("#person").textContent());
    await page.click("#restore");
    assert(heavy > parseFloat(await page.locator("#person").textContent()) + 3, "to the right is heavier");
  },
  "it can be turned and brought nearer": async (page) => {
    await seek(page, 0.3);
    await page.click("#reset");
    await settle(page);
    await pixels(page, "front");
    const box = await page.locator("#view").boundingBox();
    await page.mouse.move(box.x + box.width / 4, box.y + box.height / 2);
    await page.mouse.down();
    await page.mouse.move(box.x + box.width / 4 + 120, box.y + box.height / 2, { steps: 5 });
    await page.mouse.up();
    await settle(page);
    await pixels(page, "turned");
    await page.mouse.wheel(0, -400);
    await settle(page);
    await pixels(page, "near");
    for (const half of [0, 1]) {
      assert((await differing(page, "front", "turned", half)) > 0.01);
      assert((await differing(page, "turned", "near", half)) > 0.01);
    }
    await page.click("#reset");
    await settle(page);
    await pixels(page, "reset");
    for (const half of [0, 1]) assert.equal(await differing(page, "front", "reset", half), 0);
  },
  "another motion can be chosen, and a BVH file brought": async (page) => {
    const start = async (name) => {
      await seek(page, 0.5);
      return keep(page, name);
    };
    await start("first");
    await page.selectOption("#motion", "1");
    await page.waitForFunction(() => window.softtissue.page.motion === window.softtissue.page.motions[1].motion, undefined, PATIENCE);
    await start("second");
    assert((await moved(page, "first", "second", "alone")) > 10);
    await page.setInputFiles("#file", bvh);
    await page.waitForFunction(() => /BVH/.test(document.getElementById("facts").textContent), undefined, PATIENCE);
    assert((await start("brought")).finite);
    assert((await moved(page, "second", "brought", "alone")) > 10);
    await page.setInputFiles("#file", { name: "no.bvh", mimeType: "text/plain", buffer: Buffer.from("nothing of the kind") });
    await page.waitForFunction(() => document.getElementById("facts").classList.contains("bad"));
    assert.match(await page.locator("#facts").textContent(), /no\.bvh.*HIERARCHY/);
    await page.selectOption("#motion", "0");
    await settle(page);
  },
  "it can be light or dark": async (page) => {
    await pixels(page, "light");
    await page.click("#theme");
    await settle(page);
    await pixels(page, "dark");
    for (const half of [0, 1]) assert((await differing(page, "light", "dark", half)) > 0.5);
    await page.click("#theme");
  },
  "it fits a telephone": async (page) => {
    await page.setViewportSize({ width: 390, height: 800 });
    await page.waitForTimeout(200);
    const wide = await page.evaluate(() => document.documentElement.scrollWidth);
    assert(wide <= 390, `the page is ${wide} wide`);
    await page.setViewportSize({ width: 1280, height: 800 });
  },
};

// The snippet of docs/play.md, run where the folder's own page lies.
async function snippet(page) {
  const text = await readFile(new URL("../../docs/play.md", import.meta.url), "utf8");
  const code = text.split("```js\n")[1].split("```")[0];
  const said = page.waitForEvent("console", { predicate: (m) => m.type() === "log", ...PATIENCE });
  await page.addScriptTag({ type: "module", content: code });
  const [faces, soft, alone] = await Promise.all((await said).args().map((a) => a.evaluate((x) => [x.length, x.every(Number.isFinite)])));
  assert(faces[0] > 0 && soft[0] > 0 && soft[0] === alone[0] && soft[1] && alone[1], JSON.stringify([faces, soft, alone]));
}

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

// Frames of the bundle's rate, one after the other, in the module alone.
async function measure(page) {
  const { vertices, times } = await page.evaluate(() => {
    const { page, Player } = window.softtissue, { motion, bundle, panel } = page;
    const player = new Player(bundle, panel.beta), times = [];
    for (let i = 0; i < 600; i++) {
      motion.sample((i / bundle.fps) % motion.seconds);
      const start = performance.now();
      player.step(motion.pose, motion.root, 0);
      times.push(performance.now() - start);
    }
    player.free();
    return { vertices: bundle.vertices, times: times.slice(120).sort((a, b) => a - b) };
  });
  const [at, mean] = [(share) => times[Math.floor(share * (times.length - 1))].toFixed(2), times.reduce((a, b) => a + b) / times.length];
  console.log(`player: ${vertices} vertices, ms a frame: least ${at(0)}, median ${at(0.5)}, mean ${mean.toFixed(2)}, 95 % under ${at(0.95)}`);
}

async function photograph(page) {
  if (!pictures) return;
  await page.click("#reset");
  for (const [theme, name] of [["light", "page-light"], ["dark", "page-dark"]]) {
    await page.evaluate((theme) => { document.documentElement.dataset.theme = theme; window.softtissue.page.readColours(); }, theme);
    await seek(page, 0.55);
    await page.screenshot({ path: join(pictures, name + ".png") });
  }
  await page.setViewportSize({ width: 390, height: 800 });
  await settle(page);
  await page.screenshot({ path: join(pictures, "page-telephone.png"), fullPage: true });
}

const browser = await chromium.launch({ executablePath, args });
await check("it opens under a path of any server, and asks for nothing else", async () => {
  const { page, complaints } = await open(browser, hosted);
  await seek(page, 0.5);
  assert((await keep(page, "hosted")).apart > 0.1);
  await snippet(page);
  assert.deepEqual(complaints, []);
  await page.close();
});
{
  const { page, complaints } = await open(browser, view);
  for (const name in tests) await check(name, () => tests[name](page));
  await check("nothing outside was asked for and nothing complained", () => assert.deepEqual(complaints, []));
  await measure(page);
  await photograph(page);
}
await browser.close();
const without = await chromium.launch({ executablePath, args: ["--no-sandbox", "--disable-3d-apis"] });
await check("without WebGL a sentence says so", async () => {
  const page = await without.newPage();
  await page.goto(view);
  await page.locator(".notice.bad").waitFor(PATIENCE);
  assert.match(await page.locator("#notice-text").textContent(), /no WebGL/);
});
await without.close();
plain.close();
console.log(`${passed} passed, ${failed} failed`);
process.exitCode = failed ? 1 : 0;
