// Plays sequences and compares with what `dcloth run` wrote; the same code in Node and inside the browser.

/** Rows in the file, columns in a pose of three.js. @type {(rows: Float32Array, pose: Float32Array) => void} */
export function transpose(rows, pose) {
  for (let at = 0; at < rows.length; at += 16) {
    for (let r = 0; r < 4; ++r) for (let c = 0; c < 4; ++c) pose[at + 4 * c + r] = rows[at + 4 * r + c];
  }
}

/** @type {(a: Float32Array, b: Float32Array) => { mean: number, max: number }} millimetres; NaN shows in both */
export function distanceMm(a, b) {
  if (a.length !== b.length || a.length === 0) throw new Error(`${a.length} numbers against ${b.length}`);
  let sum = 0, max = 0;
  for (let i = 0; i < a.length; i += 3) {
    const distance = 1000 * Math.hypot(a[i] - b[i], a[i + 1] - b[i + 1], a[i + 2] - b[i + 2]);
    sum += distance;
    if (!(distance <= max)) max = distance;
  }
  return { mean: (3 * sum) / a.length, max };
}

/** Vertices against their mean: the shape without the way that the character went. */
function shapeOf(positions) {
  const mean = [0, 0, 0];
  for (let i = 0; i < positions.length; ++i) mean[i % 3] += (3 * positions[i]) / positions.length;
  return positions.map((value, i) => value - mean[i % 3]);
}

/**
 * A garment at the tick rate. `how`: "tick" for tick and skin as the command line does, "update" for update.
 * @param {any} cloth of createCloth({ jointNames, rowMajor: true })
 * @param {any} sequence tensors and metadata
 * @param {any} native what `dcloth run` wrote
 * @param {"tick" | "update"} how
 */
export function compareWithNative(cloth, sequence, native, how) {
  const { shape, data } = sequence.tensors.joint_matrices;
  const [frames, vertices] = native.tensors.positions.shape;
  if (frames !== shape[0] || vertices !== cloth.model.vertexCount || frames < 100) {
    throw new Error(`${frames} frames of ${vertices} vertices for ${shape[0]} of ${cloth.model.vertexCount}`);
  }
  const step = 16 * shape[1], size = 3 * vertices;
  const result = { frames, mean: 0, max: 0, changed: 0, microseconds: 0 };
  const first = shapeOf(native.tensors.positions.data.subarray(0, size));
  cloth.reset();
  const times = [];
  for (let f = 0; f < frames; ++f) {
    cloth.pose.set(data.subarray(f * step, (f + 1) * step));
    const start = performance.now();
    if (how === "tick") {
      cloth.tick();
      cloth.skin(1);
    } else {
      cloth.update(cloth.model.tickSeconds);
    }
    times.push(performance.now() - start);
    const distance = distanceMm(cloth.positions, native.tensors.positions.data.subarray(f * size, (f + 1) * size));
    result.mean += distance.mean / frames;
    if (!(distance.max <= result.max)) result.max = distance.max;
    if (f % 10 === 9) result.changed = Math.max(result.changed, distanceMm(shapeOf(cloth.positions), first).mean);
  }
  // What others do on the machine is not in the fastest tenth.
  result.microseconds = 1000 * times.sort((a, b) => a - b)[Math.floor(frames / 10)];
  return result;
}
