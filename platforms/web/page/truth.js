// All halves as floats, once: 256 KB.
const FLOAT_OF_HALF = new Float32Array(65536);
for (let bits = 0; bits < 65536; ++bits) {
  const exponent = (bits >> 10) & 31, fraction = bits & 1023;
  let value = exponent === 0 ? fraction * 2 ** -24 : (1024 + fraction) * 2 ** (exponent - 25);
  if (exponent === 31) value = fraction === 0 ? Infinity : NaN;
  FLOAT_OF_HALF[bits] = bits & 32768 ? -value : value;
}

/** The simulated cloth of a sequence: what the network was trained to reach. */
export class Truth {
  #halves;
  #origins;
  #frames;
  #fps;

  /** @param {{ tensors: any, metadata: any }} sequence with `truth` in halves and `truth_origin` */
  constructor({ tensors, metadata }) {
    this.#halves = tensors.truth.data;
    this.#origins = tensors.truth_origin.data;
    [this.#frames, this.vertexCount] = tensors.truth.shape;
    this.#fps = Number(metadata.fps);
  }

  /**
   * Mean vertex distance in millimetres to the truth at that time, blended between its frames.
   * @param {Float32Array} positions [vertexCount, 3] where the motion is
   * @param {number} seconds from the sequence's start
   */
  distanceMm(positions, seconds) {
    const time = Math.min(Math.max(seconds, 0) * this.#fps, this.#frames - 1);
    const frame = Math.min(Math.floor(time + 1e-6), this.#frames - 1), next = Math.min(frame + 1, this.#frames - 1);
    const blend = Math.max(0, time - frame);
    const o = this.#origins, h = this.#halves, size = 3 * this.vertexCount;
    const ox = o[3 * frame] + blend * (o[3 * next] - o[3 * frame]);
    const oy = o[3 * frame + 1] + blend * (o[3 * next + 1] - o[3 * frame + 1]);
    const oz = o[3 * frame + 2] + blend * (o[3 * next + 2] - o[3 * frame + 2]);
    let sum = 0;
    for (let i = 0, a = frame * size, b = next * size; i < size; i += 3, a += 3, b += 3) {
      const ax = FLOAT_OF_HALF[h[a]], ay = FLOAT_OF_HALF[h[a + 1]], az = FLOAT_OF_HALF[h[a + 2]];
      const x = positions[i] - ox - ax - blend * (FLOAT_OF_HALF[h[b]] - ax);
      const y = positions[i + 1] - oy - ay - blend * (FLOAT_OF_HALF[h[b + 1]] - ay);
      const z = positions[i + 2] - oz - az - blend * (FLOAT_OF_HALF[h[b + 2]] - az);
      sum += Math.sqrt(x * x + y * y + z * z);
    }
    return (1000 * sum) / this.vertexCount;
  }
}
