// Reads what html_report.cc wrote: one JSON object and numbered blobs, each the base64 of a zlib stream.
// A blob is unpacked when it is first asked for, so a report opens before its largest sequence is decoded.

const report = JSON.parse(document.getElementById('report-data').textContent);

async function readBlob(index) {
  const text = atob(document.getElementById(`blob-${index}`).textContent);
  const packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream('deflate'));
  return new Response(stream).arrayBuffer();
}

// Largest mesh neighbour with a smaller index, or the vertex before; -1 for vertex 0. track_codec.cc has the same rule.
function spatialParents(faces, count) {
  const parents = new Int32Array(count).fill(-1);
  for (let f = 0; f < faces.length; f += 3) {
    for (let k = 0; k < 3; k++) {
      const a = faces[f + k];
      const b = faces[f + (k + 1) % 3];
      const low = Math.min(a, b);
      const high = Math.max(a, b);
      if (low < high && low > parents[high]) parents[high] = low;
    }
  }
  for (let i = 1; i < count; i++) if (parents[i] < 0) parents[i] = i - 1;
  return parents;
}

// A track is [frames][xyz][count] int16 quanta about the frame's origin, in parts of some frames. Stored per number:
// (value - prediction), minus the same of the parent vertex, zigzag, low bytes of the whole part before its high bytes.
// Arithmetic wraps at 16 bits.
const PREDICT_PREVIOUS = 1, PREDICT_LINEAR = 2, PREDICT_REFERENCE = 3, PREDICT_REFERENCE_MOTION = 4;

function decodeFrames(bytes, parents, predictor, reference, out) {
  const count = parents.length;
  const plane = 3 * count;
  const total = out.length;
  const frames = total / plane;
  const residual = new Int16Array(count);
  for (let f = 0; f < frames; f++) {
    for (let c = 0; c < 3; c++) {
      const base = f * plane + c * count;
      for (let i = 0; i < count; i++) {
        const at = base + i;
        const zigzag = bytes[at] | bytes[total + at] << 8;
        const parent = parents[i];
        residual[i] = ((zigzag >>> 1) ^ -(zigzag & 1)) + (parent < 0 ? 0 : residual[parent]);
        let predicted = 0;
        if (predictor >= PREDICT_REFERENCE) {
          predicted = reference[at];
          if (predictor === PREDICT_REFERENCE_MOTION && f > 0) predicted += out[at - plane] - reference[at - plane];
        } else if (predictor > 0 && f > 0) {
          predicted = out[at - plane];
          if (predictor === PREDICT_LINEAR && f > 1) predicted += out[at - plane] - out[at - 2 * plane];
        }
        out[at] = residual[i] + predicted;
      }
    }
  }
}

async function loadGarment() {
  const faces = new Uint16Array(await readBlob(report.faces));
  return {faces, count: report.vertex_count, parents: spatialParents(faces, report.vertex_count)};
}

// Null for what the browser cannot show.
async function loadPicture(index) {
  const url = URL.createObjectURL(new Blob([await readBlob(index)]));
  return new Promise((resolve) => {
    const image = new Image();
    image.onload = () => resolve(image);
    image.onerror = () => resolve(null);
    image.src = url;
  });
}

async function loadBody() {
  if (!report.body) return null;
  const b = report.body;
  const pictures = await Promise.all((b.pictures || []).map(loadPicture));
  const faces = new Uint32Array(await readBlob(b.faces));
  const same = b.same === undefined ? null : new Uint32Array(await readBlob(b.same));
  return {
    same,
    smoothFaces: same ? faces.map((v) => same[v]) : faces,
    textureCoordinates: same ? new Float32Array(await readBlob(b.texture_coordinates)) : null,
    parts: (b.parts || []).map((part) => ({...part, picture: pictures[part.picture] || null})),
    count: b.count,
    rest: new Float32Array(await readBlob(b.positions)),
    faces,
    joints: new Uint16Array(await readBlob(b.joints)),
    weights: new Float32Array(await readBlob(b.weights)),
    colours: b.colours ? Float32Array.from(new Uint8Array(await readBlob(b.colours)), (c) => (c / 255) ** 2.2) : null,
  };
}

const loadedSequences = new Map();

// Joints are [frames][joints][12]: skinning matrices G B^-1 where the report has a body, else joint-to-world matrices.
async function loadSequence(index, garment) {
  if (loadedSequences.has(index)) return loadedSequences.get(index);
  const stored = report.sequences[index];
  const tracks = new Map();
  const byIndex = [];
  for (const track of stored.tracks) {
    const values = new Int16Array(3 * garment.count * stored.frames);
    let from = 0;
    for (const part of track.parts) {
      const to = from + 3 * garment.count * part.frames;
      const reference = part.reference < 0 ? null : byIndex[part.reference].subarray(from, to);
      decodeFrames(new Uint8Array(await readBlob(part.data)), garment.parents, part.predictor, reference,
                   values.subarray(from, to));
      from = to;
    }
    byIndex.push(values);
    tracks.set(track.name, values);
  }
  const sequence = {
    name: stored.name,
    frames: stored.frames,
    fps: stored.fps,
    origins: new Int32Array(await readBlob(stored.origins)),
    joints: new Float32Array(await readBlob(stored.joints)),
    hips: new Float32Array(await readBlob(stored.hips)),
    tracks,
    errors: stored.error_mm,
  };
  loadedSequences.set(index, sequence);
  return sequence;
}
