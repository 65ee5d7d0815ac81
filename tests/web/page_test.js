// The page in a real Chromium, headless, with software rendering: it loads, moves, draws, equals the native engine.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { after, before, test } from "node:test";
import { fileURLToPath } from "node:url";
import { Browser } from "./browser.js";
import { native, sequences, site } from "./files.js";
import { serve } from "./server.js";

const ALLOWED_MM = 0.1;
const here = fileURLToPath(new URL(".", import.meta.url));
/** @type {any} */ let server;
/** @type {any} */ let browser;

before(async () => {
  server = await serve({ "/": site, "/native/": native, "/tests/": here });
  browser = await Browser.start({ width: 1280, height: 800 });
});
after(async () => {
  await browser?.close();
  server?.close();
});

/** Calls a function inside the page. @type {(call: (...args: any[]) => any, ...args: any[]) => Promise<any>} */
const inPage = (call, ...args) => browser.evaluate(`(${call})(...${JSON.stringify(args)})`);

/** Opens the page and waits until it is ready. @param {string} query */
async function open(query) {
  browser.complaints.length = 0;
  await browser.open(`${server.origin}/index.html${query}`);
  for (let i = 0; i < 600; ++i) {
    if (await inPage(() => typeof dclothPage !== "undefined").catch(() => false)) break;
    await new Promise((resolve) => setTimeout(resolve, 200));
  }
  await inPage(() => dclothPage.then(() => true));
}

/** @param {string} name */
async function keepPicture(name) {
  const folder = process.env.DCLOTH_WEB_PICTURES;
  if (folder) writeFileSync(`${folder}/${name}.png`, await browser.screenshot());
}

/** What pages complain of, without what a driver says of being read from. */
const complaints = () => browser.complaints.filter((text) => !/GPU stall due to ReadPixels/.test(text));

/** Steps the clock by hand; draws at the end. */
const play = (frames, seconds) => inPage(async (count, step) => {
  const page = await dclothPage;
  for (let i = 0; i < count; ++i) page.step(step);
  page.draw();
}, frames, seconds);

test("loads with SIMD and without a complaint", async () => {
  await open("?still");
  const seen = await inPage(async () => {
    const page = await dclothPage;
    return { kernels: page.engine.instructionSet, badge: document.getElementById("isa").textContent,
      message: document.getElementById("message").textContent, characters: page.crowd.characters.length,
      errors: page.costs.errorMm, rows: document.querySelectorAll("#levels tr").length };
  });
  assert.deepEqual(complaints(), []);
  assert.equal(seen.kernels, "wasm");
  assert.equal(seen.badge, "WebAssembly SIMD");
  assert.equal(seen.message, "");
  assert.equal(seen.characters, 3);
  assert.equal(seen.rows, 4);
  assert.ok(seen.errors[4] < seen.errors[1] && seen.errors[4] > 0, `${seen.errors}`);
});

test("a Web Worker draws what the page's own engine draws", async () => {
  await open("?still");
  const seen = await inPage(async () => {
    const { startWorker } = await import("/dcloth/worker.js");
    const { loadEngine } = await import("/dcloth/index.js");
    const engine = await loadEngine(), worker = await startWorker();
    const models = [await engine.fetchModel("garment/skirt.dcloth"), await worker.fetchModel("garment/skirt.dcloth")];
    const cloths = await Promise.all(models.map((model) => model.createCloth({ jointNames: model.jointNames })));
    let apart = 0, height = 0;
    for (let frame = 0; frame < 30; ++frame) {
      for (const cloth of cloths) {
        cloth.pose.set(models[0].bindMatrices);
        for (let j = 12; j < cloth.pose.length; j += 16) cloth.pose[j] += 0.01 * frame;
        await cloth.update(1 / 30);
      }
      cloths[0].positions.forEach((x, i) => { apart = Math.max(apart, Math.abs(x - cloths[1].positions[i])); });
      height = Math.max(height, cloths[1].bounds[4]);
    }
    worker.terminate();
    return { apart, height, vertices: cloths[1].positions.length / 3, kernels: worker.instructionSet };
  });
  assert.deepEqual([seen.apart, seen.kernels], [0, "wasm"]);
  assert.ok(seen.vertices > 1000 && seen.height > 0.5, JSON.stringify(seen));
  assert.deepEqual(complaints(), []);
});

test("the browser's vertices are the native ones", async () => {
  for (const name of sequences) {
    const result = await inPage(async (sequenceName) => {
      const { crowd } = await dclothPage;
      const { compareWithNative } = await import("/tests/playback.js");
      const { fetchSafetensors } = await import("/page/safetensors.js");
      const sequence = await fetchSafetensors(`/garment/${sequenceName}.safetensors`);
      const expected = await fetchSafetensors(`/native/${sequenceName}.safetensors`);
      const cloth = crowd.model.createCloth({ jointNames: JSON.parse(sequence.metadata.joint_names), rowMajor: true });
      const compared = compareWithNative(cloth, sequence, expected, "update");
      cloth.dispose();
      return compared;
    }, name);
    console.log(`chromium, ${name}: ${result.frames} frames, mean ${result.mean.toFixed(5)} mm, largest ` +
      `${result.max.toFixed(5)} mm from native`);
    assert.ok(result.max < ALLOWED_MM, `${result.max} mm`);
    assert.ok(result.changed > 5, `the cloth keeps its shape: ${result.changed} mm`);
  }
});

test("the page's own character is the native one, and moves", async () => {
  const result = await inPage(async () => {
    const { crowd } = await dclothPage;
    const { distanceMm } = await import("/tests/playback.js");
    const { fetchSafetensors } = await import("/page/safetensors.js");
    const { positions } = (await fetchSafetensors("/native/walk_turn.safetensors")).tensors;
    const size = 3 * positions.shape[1];
    crowd.apply({ characters: 1, budgetMs: 1e6, topLevel: 4, outsideBody: false });
    const [character] = crowd.characters;
    character.restart(0);
    let max = 0;
    const shown = [];
    for (let f = 0; f < positions.shape[0]; ++f) {
      crowd.update(f === 0 ? 0 : 1 / 30);
      const { max: off } = distanceMm(character.cloth.positions, positions.data.subarray(f * size, (f + 1) * size));
      if (!(off <= max)) max = off;
      if (f === 20 || f === 60) {
        crowd.show();
        shown.push(character.geometry.getAttribute("position").array.slice());
      }
    }
    return { max, moved: distanceMm(shown[0], shown[1]).mean, truth: character.measure() };
  });
  console.log(`page: ${result.max.toFixed(5)} mm from native at most; ${result.truth.toFixed(1)} mm from the truth`);
  assert.ok(result.max < ALLOWED_MM, `${result.max} mm`);
  assert.ok(result.moved > 100, `${result.moved} mm between two frames shown`);
  assert.ok(result.truth > 0.1 && result.truth < 20, `${result.truth} mm from the truth`);
});

test("one character is updated sixty times a second", async () => {
  const times = await inPage(async () => {
    const { crowd } = await dclothPage;
    crowd.apply({ characters: 1, budgetMs: 1e6, topLevel: 4, outsideBody: false });
    const found = { tick: [], draw: [], seconds: 0 };
    const start = performance.now();
    for (let i = 0; i < 240; ++i) {
      const ms = crowd.update(1 / 60);
      if (crowd.characters[0].cloth.describe().tickShare > 0.5) found.tick.push(ms);
      else found.draw.push(ms);
    }
    found.seconds = (performance.now() - start) / 1000;
    for (const list of [found.tick, found.draw]) list.sort((a, b) => a - b);
    return found;
  });
  assert.ok(times.tick.length > 80 && times.draw.length > 80, `${times.tick.length} frames with ticks`);
  // Others use the machine: what the work takes shows in the tenth of the frames that were disturbed least.
  const tenth = (list) => list[Math.floor(list.length / 10)], middle = (list) => list[list.length >> 1];
  const rate = 2000 / (tenth(times.tick) + tenth(times.draw));
  console.log(`one character, full network: frame with a tick ${tenth(times.tick).toFixed(2)} ms (p10), ` +
    `${middle(times.tick).toFixed(2)} (p50); without ${tenth(times.draw).toFixed(2)}, ` +
    `${middle(times.draw).toFixed(2)}; ${rate.toFixed(0)} updates a second undisturbed, ` +
    `${(240 / times.seconds).toFixed(0)} here and now, not drawn`);
  assert.ok(rate >= 60, `${rate} updates a second`);
});

test("sliders arrive, the cloth is seen", async () => {
  const counted = await inPage(async () => {
    const page = await dclothPage;
    const slider = document.getElementById("characters");
    const cloth = [];
    for (const count of [1, 3]) {
      slider.value = String(count);
      slider.dispatchEvent(new Event("input"));
      for (let i = 0; i < 8; ++i) page.step(1 / 30);
      page.draw();
      // Read in the same task, before the browser clears the picture.
      const canvas = new OffscreenCanvas(480, 400), context = canvas.getContext("2d");
      context.drawImage(document.getElementById("view"), 0, 0, 480, 400);
      const { data } = context.getImageData(0, 0, 480, 400);
      let teal = 0, warm = 0;
      for (let i = 0; i < data.length; i += 4) {
        if (data[i + 1] > 1.25 * data[i] && data[i + 2] > 1.15 * data[i]) ++teal;
        if (data[i] > 1.5 * data[i + 1] && data[i] > 1.5 * data[i + 2]) ++warm;
      }
      cloth.push({ characters: page.crowd.characters.length, teal, warm });
    }
    return cloth;
  });
  console.log(`pixels of 192,000: one skirt ${counted[0].teal} teal, ${counted[0].warm} terracotta; three skirts ` +
    `${counted[1].teal}, ${counted[1].warm}`);
  assert.deepEqual(counted.map((each) => each.characters), [1, 3]);
  assert.ok(counted[0].teal > 3000, "the first skirt is teal");
  assert.ok(counted[1].warm > counted[0].warm + 800, "the second one is terracotta"); // skin is warm as well
  await keepPicture("three");
  const outside = await inPage(async () => {
    const page = await dclothPage;
    page.panel.set({ characters: 5, level: 1, budget: 24 });
    for (let i = 0; i < 4; ++i) page.step(1 / 30);
    const static_ = page.crowd.levelCounts();
    page.panel.set({ level: 2 });
    return static_.slice(2).reduce((sum, count) => sum + count, 0);
  });
  assert.equal(outside, 0, "nobody is above the highest level");
  await play(40, 1 / 30);
  await keepPicture("five");
  await inPage(async () => (await dclothPage).panel.set({ characters: 24, level: 4, budget: 12 }));
  await play(30, 1 / 30);
  const counts = await inPage(async () => (await dclothPage).crowd.levelCounts());
  console.log(`24 characters in 12 ms, by costs measured there: ${counts.join(", ")} from frozen to mesh`);
  assert.equal(counts.reduce((sum, count) => sum + count), 24);
  await keepPicture("many");
  assert.deepEqual(complaints(), []);
});

test("runs by itself", async () => {
  await browser.resize({ width: 800, height: 450 }); // software draws slowly
  await open("");
  const { before: first, after: second, fps } = await inPage(async () => {
    const page = await dclothPage;
    const start = page.updates;
    for (let i = 0; i < 600 && page.updates < start + 4; ++i) await new Promise((resolve) => setTimeout(resolve, 300));
    return { before: start, after: page.updates, fps: page.fps };
  });
  console.log(`by itself: three characters drawn in software at ${fps.toFixed(1)} frames a second`);
  await browser.resize({ width: 1280, height: 800 });
  assert.ok(second >= first + 4, `${second - first} updates`);
  assert.deepEqual(complaints(), []);
});

test("says where it runs without SIMD", async () => {
  await open("?still&kernels=scalar");
  const seen = await inPage(async () => ({
    kernels: (await dclothPage).engine.instructionSet, text: document.getElementById("isa").textContent,
    slow: document.getElementById("isa").classList.contains("slow") }));
  assert.deepEqual([seen.kernels, seen.slow], ["scalar", true]);
  assert.match(seen.text, /scalar fallback \(asked for\)/);
  await play(2, 1 / 30);
  await keepPicture("scalar");
});

test("says what is wrong with a model", async () => {
  const text = await inPage(async () => {
    const { engine } = await dclothPage;
    try {
      await engine.fetchModel("garment/character.safetensors");
      return "";
    } catch (error) {
      return `${error.name} ${error.statusName} ${error.message}`;
    }
  });
  assert.match(text, /^DClothError (FORMAT|ALIGNMENT|ARGUMENT) .*character\.safetensors: .{20,}/);
});
