// Moving geometry: positions of a frame, smooth normals, fold shading, error, the skinned body, joints as sticks.

// Positions at a fractional frame, in metres; straight-line motion between two stored frames.
function framePositions(sequence, track, time, quantum, out) {
  const count = out.length / 3;
  const f0 = Math.min(Math.floor(time), sequence.frames - 1);
  const f1 = Math.min(f0 + 1, sequence.frames - 1);
  const t = time - f0;
  for (let c = 0; c < 3; c++) {
    const o0 = sequence.origins[f0 * 3 + c] * quantum * (1 - t);
    const o1 = sequence.origins[f1 * 3 + c] * quantum * t;
    const a = (f0 * 3 + c) * count;
    const b = (f1 * 3 + c) * count;
    for (let i = 0; i < count; i++) {
      out[i * 3 + c] = o0 + o1 + quantum * ((1 - t) * track[a + i] + t * track[b + i]);
    }
  }
}

// Vertex normals weighted by face area: the cross product's length already is twice the area.
function smoothNormals(positions, faces, out) {
  out.fill(0);
  for (let f = 0; f < faces.length; f += 3) {
    const a = faces[f] * 3, b = faces[f + 1] * 3, c = faces[f + 2] * 3;
    const ux = positions[b] - positions[a], uy = positions[b + 1] - positions[a + 1],
        uz = positions[b + 2] - positions[a + 2];
    const vx = positions[c] - positions[a], vy = positions[c + 1] - positions[a + 1],
        vz = positions[c + 2] - positions[a + 2];
    const x = uy * vz - uz * vy, y = uz * vx - ux * vz, z = ux * vy - uy * vx;
    for (const at of [a, b, c]) {
      out[at] += x;
      out[at + 1] += y;
      out[at + 2] += z;
    }
  }
  for (let i = 0; i < out.length; i += 3) {
    const scale = 1 / (Math.hypot(out[i], out[i + 1], out[i + 2]) || 1);
    out[i] *= scale;
    out[i + 1] *= scale;
    out[i + 2] *= scale;
  }
}

// Every vertex gets the vector of the first one in its place.
function spread(same, vectors) {
  for (let i = 0; i < same.length; i++) {
    for (let c = 0; c < 3; c++) vectors[i * 3 + c] = vectors[same[i] * 3 + c];
  }
}

// How far the neighbours stand out along the normal, per mean edge length: > 0 in a valley, < 0 on a ridge.
// Shading by it is what lets the eye read wrinkles under soft light.
function foldDepth(positions, normals, edges, out) {
  const sums = foldDepth.sums && foldDepth.sums.length === out.length * 2 ? foldDepth.sums
      : new Float32Array(out.length * 2);
  foldDepth.sums = sums;
  sums.fill(0);
  for (let e = 0; e < edges.length; e += 2) {
    const i = edges[e], j = edges[e + 1], a = i * 3, b = j * 3;
    const x = positions[b] - positions[a], y = positions[b + 1] - positions[a + 1],
        z = positions[b + 2] - positions[a + 2];
    const length = Math.sqrt(x * x + y * y + z * z);
    sums[i * 2] += x * normals[a] + y * normals[a + 1] + z * normals[a + 2];
    sums[j * 2] -= x * normals[b] + y * normals[b + 1] + z * normals[b + 2];
    sums[i * 2 + 1] += length;
    sums[j * 2 + 1] += length;
  }
  for (let i = 0; i < out.length; i++) out[i] = sums[i * 2 + 1] > 0 ? sums[i * 2] / sums[i * 2 + 1] : 0;
}

function meshEdges(faces) {
  const seen = new Set();
  const edges = [];
  for (let f = 0; f < faces.length; f += 3) {
    for (let k = 0; k < 3; k++) {
      const a = Math.min(faces[f + k], faces[f + (k + 1) % 3]);
      const b = Math.max(faces[f + k], faces[f + (k + 1) % 3]);
      const key = a * 65536 + b;
      if (!seen.has(key)) {
        seen.add(key);
        edges.push(a, b);
      }
    }
  }
  return new Uint32Array(edges);
}

function errorMillimetres(positions, truth, out) {
  for (let i = 0; i < out.length; i++) {
    out[i] = 1000 * Math.hypot(positions[i * 3] - truth[i * 3], positions[i * 3 + 1] - truth[i * 3 + 1],
                               positions[i * 3 + 2] - truth[i * 3 + 2]);
  }
}

// Twelve numbers a joint at a fractional frame. Element-wise blending is exact enough between frames 1/30 s apart.
function frameJoints(sequence, time, out) {
  const size = out.length;
  const f0 = Math.min(Math.floor(time), sequence.frames - 1);
  const f1 = Math.min(f0 + 1, sequence.frames - 1);
  const t = time - f0;
  for (let i = 0; i < size; i++) out[i] = (1 - t) * sequence.joints[f0 * size + i] + t * sequence.joints[f1 * size + i];
}

// Linear blend skinning with four influences a vertex.
function skinBody(body, joints, out) {
  for (let i = 0; i < body.count; i++) {
    const x = body.rest[i * 3], y = body.rest[i * 3 + 1], z = body.rest[i * 3 + 2];
    let px = 0, py = 0, pz = 0;
    for (let k = 0; k < 4; k++) {
      const w = body.weights[i * 4 + k];
      if (w === 0) continue;
      const m = body.joints[i * 4 + k] * 12;
      px += w * (joints[m] * x + joints[m + 1] * y + joints[m + 2] * z + joints[m + 3]);
      py += w * (joints[m + 4] * x + joints[m + 5] * y + joints[m + 6] * z + joints[m + 7]);
      pz += w * (joints[m + 8] * x + joints[m + 9] * y + joints[m + 10] * z + joints[m + 11]);
    }
    out[i * 3] = px;
    out[i * 3 + 1] = py;
    out[i * 3 + 2] = pz;
  }
}

// One octahedron a stick, thicker near its parent end, as animation tools draw bones.
function stickMesh(sticks) {
  const faces = [];
  for (let s = 0; s < sticks.length; s++) {
    const base = s * 6;
    for (let k = 0; k < 4; k++) {
      const a = base + 1 + k, b = base + 1 + (k + 1) % 4;
      faces.push(base, b, a, base + 5, a, b);
    }
  }
  return new Uint32Array(faces);
}

function stickPositions(sticks, joints, out) {
  const at = (j) => [joints[j * 12 + 3], joints[j * 12 + 7], joints[j * 12 + 11]];
  sticks.forEach(([parent, child], s) => {
    const a = at(parent), b = at(child);
    const along = subtract(b, a);
    const length = Math.hypot(...along);
    const axis = normalize(along);
    const side = normalize(cross(axis, Math.abs(axis[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0]));
    const other = cross(axis, side);
    const radius = clamp(length * 0.12, 0.006, 0.03);
    const waist = add(a, along, 0.2);
    const points = [a, add(waist, side, radius), add(waist, other, radius), add(waist, side, -radius),
                    add(waist, other, -radius), b];
    points.forEach((p, k) => out.set(p, (s * 6 + k) * 3));
  });
}
