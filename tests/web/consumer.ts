// A host in TypeScript, as strict as it gets; compiled by types_test.js against the package as users have it.
import { Axis, DClothError, FrameFlags, Levels, loadEngine, Roles, Stages, STEPS } from "dcloth";
import type { Cloth, Engine, Model } from "dcloth";
import { startWorker } from "dcloth/worker";
import type { WorkerCloth } from "dcloth/worker";

export async function start(bones: { name: string; matrix: Float32Array }[], bytes: ArrayBuffer): Promise<Cloth> {
  const engine: Engine = await loadEngine({ kernels: "auto" });
  const slow: boolean = engine.instructionSet === "scalar";
  if (slow) console.warn(engine.fallback);
  const model: Model = engine.openModel(bytes);
  const space = { left: Axis.X, up: Axis.Y, forward: Axis.Z, metresPerUnit: 0.01 };
  const cloth = model.createCloth({ jointNames: bones.map((bone) => bone.name), space });
  const body = { positions: new Float32Array(9), joints: new Uint16Array(12), weights: new Float32Array(12) };
  const character = { jointNames: ["Root"], bindMatrices: model.bindMatrices, jointRoles: [Roles.HIPS], body };
  const gap: number | undefined = model.createCloth({ space, character }).fit?.gapMm;
  if (gap !== undefined && gap > 15) console.warn(`${gap} mm`);
  bones.forEach((bone, j) => cloth.pose.set(bone.matrix, 16 * j));
  try {
    cloth.update(1 / 60, Stages.SKELETON, FrameFlags.PIPELINED | FrameFlags.FREEZE_IDLE);
  } catch (error) {
    if (error instanceof DClothError) console.error(error.status, error.statusName, error.offsetBytes, error.message);
  }
  const timer = engine.createTimer();
  cloth.timer = timer;
  const lag: number = cloth.describe().lagSeconds;
  const scene = engine.createScene(1);
  const tickMicroseconds = [0, 1, 2, 3, 4], errorMm = [4, 3, 2, 1, 0];
  scene.set(0, { cloth, importance: lag, drawMicroseconds: 1, tickMicroseconds, errorMm });
  scene.plan(1 / 60, 1000);
  const top: boolean = scene.level(0) === Levels.MESH;
  console.log(STEPS.map((name, step) => `${name} ${timer.microseconds(step)}`), top, model.triangles.length);
  return cloth;
}

export async function startThere(bytes: ArrayBuffer): Promise<WorkerCloth> {
  const worker = await startWorker({ kernels: "auto" });
  const model = await worker.openModel(bytes);
  const cloth = await model.createCloth({ jointNames: model.jointNames });
  cloth.pose.set(model.bindMatrices);
  if (!cloth.busy) await cloth.update(1 / 60);
  const positions: Float32Array = cloth.positions;
  console.log(positions.length, cloth.fit?.gapMm, (await cloth.save()).length);
  worker.terminate();
  return cloth;
}

export async function wrong(cloth: Cloth): Promise<void> {
  // @ts-expect-error: no such kernels
  await loadEngine({ kernels: "fast" });
  // @ts-expect-error: seconds are missing
  cloth.update();
  // @ts-expect-error: a view is not to be replaced
  cloth.positions = new Float32Array(3);
  // @ts-expect-error: not a constant of the ABI
  cloth.stages = Stages.MESHES;
  // @ts-expect-error: a number, not a name
  cloth.model.createCloth({ space: { left: "x", up: "y", forward: "z" } });
}
