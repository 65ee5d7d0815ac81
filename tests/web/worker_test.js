// The engine in a worker against the engine in this thread: the same vertices, errors, order, memory. In Node's
// workers; a Web Worker is in page_test.js.
import assert from "node:assert/strict";
import test from "node:test";
import { Worker } from "node:worker_threads";
import { bytesOf, load, model as modelFile, modules, site, tensorsOf } from "./files.js";
import { transpose } from "./playback.js";

const { DClothError, FrameFlags, Stages } = await import(`${site}/dcloth/index.js`);
const { startWorker } = await import(`${site}/dcloth/worker.js`);
const file = bytesOf(modelFile);
const sequence = tensorsOf(`${site}/garment/walk_turn.safetensors`);
const jointNames = JSON.parse(sequence.metadata.joint_names);
const start = (options) =>
  startWorker({ worker: new Worker(`${site}/dcloth/worker_node.js`), simd: bytesOf(modules.simd), ...options });

/** @type {(cloth: any, frame: number) => void} */
function pose(cloth, frame) {
  const step = 16 * jointNames.length;
  transpose(sequence.tensors.joint_matrices.data.subarray(frame * step, (frame + 1) * step), cloth.pose);
}

/** @type {(call: Promise<unknown>, statusName: string, message: RegExp) => Promise<void>} */
async function refused(call, statusName, message) {
  await assert.rejects(call, (error) => {
    assert.ok(error instanceof DClothError, String(error));
    assert.equal(error.statusName, statusName, error.message);
    assert.match(error.message, message);
    return true;
  });
}

/** @type {(a: any, b: any) => void} */
function assertEqualFrame(a, b) {
  for (const what of ["positions", "normals", "bounds"]) {
    assert.ok(a[what].length > 0);
    assert.deepEqual(Buffer.compare(new Uint8Array(a[what].buffer, a[what].byteOffset, a[what].byteLength),
      new Uint8Array(b[what].buffer, b[what].byteOffset, b[what].byteLength)), 0, what);
  }
}

const engine = await load("simd");
const here = engine.openModel(file, "skirt");
const worker = await start();
const there = await worker.openModel(file, "skirt");
test.after(() => worker.terminate());

test("a model in the worker says what it holds", () => {
  assert.deepEqual([worker.version, worker.instructionSet, worker.fallback], [engine.version, "wasm", ""]);
  for (const what of ["name", "precision", "format", "jointCount", "vertexCount", "triangleCount", "stages",
      "tickSeconds",
    "hasBody", "readsWind", "clothBytes", "jointNames", "jointParents", "triangles", "bindMatrices"]) {
    assert.deepEqual(there[what], here[what], what);
  }
});

test("vertices are those of the engine in this thread, to the bit", async () => {
  const cloth = here.createCloth({ jointNames }), other = await there.createCloth({ jointNames });
  assert.equal(other.positions.length, 3 * here.vertexCount);
  assert.equal(other.fit, null);
  const same = async (frame, seconds) => {
    for (const one of [cloth, other]) pose(one, frame);
    cloth.update(seconds);
    await other.update(seconds);
    assertEqualFrame(other, cloth);
  };
  for (let frame = 0; frame < 40; ++frame) await same(frame, 1 / 60);
  for (const one of [cloth, other]) Object.assign(one, { stages: Stages.SKELETON, flags: FrameFlags.PIPELINED });
  await same(40, 1 / 60);
  for (const one of [cloth, other]) one.outsideBody = true;
  await same(41, 1 / 60);
  for (const one of [cloth, other]) one.jump();
  await same(100, 1 / 60);
  cloth.setWind(0, 0, -6);
  await other.setWind(0, 0, -6);
  for (let frame = 101; frame < 110; ++frame) await same(frame, 1 / 30);
  const state = await other.save();
  assert.deepEqual(state, cloth.save());
  cloth.reset();
  await other.reset();
  await same(0, 1 / 30);
  cloth.restore(state);
  await other.restore(state);
  await same(110, 1 / 30);
  const before = other.positions;
  for (const one of [cloth, other]) one.visible = false;
  pose(other, 111);
  await other.update(1 / 30);
  assert.equal(other.positions, before);
  pose(other, 0);
  await other.takeBindPose();
  cloth.dispose();
  await other.dispose();
});

test("two buffers serve a cloth, and a frame stays until the next has come", async () => {
  const cloth = await there.createCloth({ jointNames });
  let made = 0;
  const Plain = globalThis.ArrayBuffer;
  globalThis.ArrayBuffer = class extends Plain {
    constructor(size) {
      super(size);
      ++made;
    }
  };
  try {
    for (let frame = 0; frame < 20; ++frame) {
      pose(cloth, frame);
      const shown = cloth.positions, height = shown[1];
      assert.equal(cloth.busy, false);
      const coming = cloth.update(1 / 30);
      assert.equal(cloth.busy, true);
      assert.deepEqual([cloth.positions, shown[1]], [shown, height]);
      assert.equal(await coming, cloth);
      assert.notEqual(cloth.positions, shown);
    }
  } finally {
    globalThis.ArrayBuffer = Plain;
  }
  assert.equal(made, 1);      // the other one was made with the cloth
  await cloth.dispose();
});

test("updates that were sent together come in order", async () => {
  const cloth = here.createCloth({ jointNames }), other = await there.createCloth({ jointNames });
  const frames = [];
  const coming = [0, 1, 2, 3, 4].map((frame) => {
    pose(other, frame);
    return other.update(1 / 30).then(() => frames.push(other.positions.slice()));
  });
  await Promise.all(coming);
  assert.equal(frames.length, 5);
  frames.forEach((positions, frame) => {
    pose(cloth, frame);
    cloth.update(1 / 30);
    assert.deepEqual(positions, cloth.positions.slice());
  });
  cloth.dispose();
  await other.dispose();
});

test("a fit comes back, and its garment", async () => {
  const larger = here.bindMatrices.map((value, i) => (i % 16 >= 12 && i % 16 < 15 ? 1.2 * value : value));
  const character = { jointNames: here.jointNames.map((name) => `mixamorig:${name}`), bindMatrices: larger };
  const cloth = here.createCloth({ character }), other = await there.createCloth({ character });
  assert.ok(other.fit.joints.size > 10);
  assert.deepEqual(other.fit, cloth.fit);
  for (const one of [cloth, other]) one.pose.set(larger);
  cloth.update(1 / 30);
  await other.update(1 / 30);
  assertEqualFrame(other, cloth);
  cloth.dispose();
  await other.dispose();
});

test("errors carry the engine's text and leave the cloth as it was", async () => {
  await refused(worker.openModel(file.slice(0, 4096), "cut.dcloth"), "FORMAT", /^cut\.dcloth: .{20,}/);
  await refused(there.createCloth({ jointNames: ["Hips", "Köpfchen"] }), "JOINTS", /'Spine'/);
  await assert.rejects(there.createCloth({ uv: new Float32Array(7) }), /7 texture coordinates/);
  const cloth = await there.createCloth({ jointNames });
  pose(cloth, 0);
  await cloth.update(0);
  const shown = cloth.positions.slice();
  cloth.pose[5] = NaN;
  await refused(cloth.update(1 / 30), "POSE", /NaN/);
  assert.equal(cloth.busy, false);
  assert.deepEqual(cloth.positions, shown);
  pose(cloth, 1);
  await refused(cloth.update(-1), "ARGUMENT", /dcloth_cloth_update/);
  await refused(cloth.restore(new Uint8Array(100)), "FORMAT", /.{20,}/);
  await cloth.update(1 / 30);
  assert.notDeepEqual(cloth.positions, shown);
  await cloth.dispose();
  await cloth.dispose();
  await assert.rejects(cloth.update(1 / 30), /cloth was disposed of/);
});

test("a worker that cannot start, or has ended, says so", async () => {
  await assert.rejects(startWorker(), /no Web Workers here; mend/);
  await assert.rejects(start({ kernels: "fast" }), /allowed: auto, simd, scalar/);
  await assert.rejects(start({ simd: bytesOf(modules.scalar) }), /runs scalar kernels; expected: wasm/);
  const broken = new Worker("throw new Error('broken')", { eval: true });
  await assert.rejects(startWorker({ worker: broken }), /the worker failed: broken/);
  const ended = await start();
  const waiting = ended.openModel(file);
  ended.terminate();
  await assert.rejects(waiting, /terminated/);
  await assert.rejects(ended.openModel(file), /terminated/);
});

test("a model goes when its last cloth has gone", async () => {
  const model = await worker.openModel(file);
  const cloth = await model.createCloth({ jointNames });
  await model.dispose();
  await assert.rejects(model.createCloth(), /model was disposed of/);
  pose(cloth, 0);
  await cloth.update(0);
  assert.ok(cloth.bounds[4] > cloth.bounds[1]);
  await cloth.dispose();
});
