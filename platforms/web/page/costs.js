import { FrameFlags, Levels, Stages } from "dcloth";

export const LEVELS = [
  { level: Levels.FROZEN, name: "frozen", stages: Stages.STATIC, flags: FrameFlags.HOLD },
  { level: Levels.STATIC, name: "static", stages: Stages.STATIC, flags: 0 },
  { level: Levels.SKELETON, name: "skeleton", stages: Stages.SKELETON, flags: 0 },
  { level: Levels.MESH, name: "mesh", stages: Stages.MESH, flags: 0 },
];

const FRAMES = 36;

/** The first quarter: what others do on the machine is not part of a cost; Scene.plan is told of it by `spent`.
 * @param {number[]} values */
function undisturbed(values) {
  return values.sort((a, b) => a - b)[values.length >> 2];
}

/** @param {number[]} values */
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

/** @type {(a: Float32Array, b: Float32Array) => number} */
function meanDistanceMm(a, b) {
  let sum = 0;
  for (let i = 0; i < a.length; i += 3) sum += Math.hypot(a[i] - b[i], a[i + 1] - b[i + 1], a[i + 2] - b[i + 2]);
  return (3000 * sum) / a.length;
}

/**
 * What each level costs on this machine, how far from the truth it is and how far from the whole network, on a stretch
 * of motion, level by level, with a pause between two so that the page stays alive.
 * @param {import("dcloth").Model} model
 * @param {import("./motion.js").Motion} motion
 * @param {import("./truth.js").Truth} truth
 */
export async function measureLevels(model, motion, truth) {
  const costs = { drawMicroseconds: 0, outsideMicroseconds: 0, tickMicroseconds: [0, 0, 0, 0, 0],
    errorMm: [0, 0, 0, 0, 0], farMm: [0, 0, 0, 0, 0] }; // by Levels
  /** @type {Float32Array[]} */
  const full = []; // the whole network's frames
  const first = Math.min(60, Math.max(0, motion.frameCount - FRAMES));
  const cloth = model.createCloth({ jointNames: motion.jointNames });
  const tick = model.tickSeconds;
  const draw = [], outside = [];
  for (const { level, stages, flags } of [...LEVELS].reverse()) {
    await new Promise((resolve) => setTimeout(resolve));
    const times = [], errors = [], far = [];
    cloth.reset();
    cloth.flags = 0; // the first tick; then those of the level
    for (let f = 0; f < FRAMES; ++f) {
      motion.at((first + f) / motion.fps, cloth.pose);
      const start = performance.now();
      cloth.update(tick, Math.min(stages, model.stages));
      const ticked = performance.now();
      cloth.flags = flags;
      cloth.update(0, Math.min(stages, model.stages)); // drawing alone
      const drawn = performance.now();
      if (f < FRAMES / 3) continue; // to settle, and for the compiler of the browser
      draw.push(drawn - ticked);
      times.push(ticked - start - (drawn - ticked));
      if (level === Levels.MESH) full[f] = cloth.positions.slice();
      far.push(meanDistanceMm(cloth.positions, full[f]));
      errors.push(truth.distanceMm(cloth.positions, (first + f) / motion.fps));
    }
    costs.tickMicroseconds[level] = level === Levels.FROZEN ? 0 : Math.max(1, 1000 * undisturbed(times));
    costs.errorMm[level] = mean(errors);
    costs.farMm[level] = mean(far);
  }
  cloth.outsideBody = true;
  for (let i = 0; model.hasBody && i < FRAMES / 3; ++i) {
    const start = performance.now();
    cloth.update(0);
    outside.push(performance.now() - start);
  }
  costs.drawMicroseconds = 1000 * undisturbed(draw);
  costs.outsideMicroseconds = model.hasBody ? 1000 * undisturbed(outside) : costs.drawMicroseconds;
  cloth.dispose();
  return costs;
}
