import { Quaternion, Vector3, Matrix4 } from "three";

/** A recorded motion, drawn at any time: rotations are slerped, positions blended, as `dcloth run` does. */
export class Motion {
  #rotations;
  #positions;
  #a = new Quaternion();
  #b = new Quaternion();
  #p = new Vector3();
  #one = new Vector3(1, 1, 1);
  #matrix = new Matrix4();

  /** @param {{ tensors: any, metadata: any }} sequence a .safetensors sequence */
  constructor({ tensors, metadata }) {
    const { shape, data } = tensors.joint_matrices;
    [this.frameCount, this.jointCount] = shape;
    this.fps = Number(metadata.fps);
    this.jointNames = JSON.parse(metadata.joint_names);
    this.seconds = (this.frameCount - 1) / this.fps;
    this.#rotations = new Float64Array(this.frameCount * this.jointCount * 4);
    this.#positions = new Float64Array(this.frameCount * this.jointCount * 3);
    for (let i = 0; i < this.frameCount * this.jointCount; ++i) {
      this.#matrix.fromArray(data, 16 * i).transpose(); // rows are contiguous in the file
      this.#a.setFromRotationMatrix(this.#matrix).toArray(this.#rotations, 4 * i);
      this.#p.setFromMatrixPosition(this.#matrix).toArray(this.#positions, 3 * i);
    }
  }

  /**
   * @param {number} seconds from the start; beyond the end it stands still
   * @param {Float32Array} pose [jointCount, 16], columns contiguous
   */
  at(seconds, pose) {
    const time = Math.min(Math.max(seconds, 0), this.seconds) * this.fps;
    const frame = Math.min(Math.floor(time + 1e-6), this.frameCount - 1);
    const next = Math.min(frame + 1, this.frameCount - 1);
    const blend = Math.max(0, time - frame);
    for (let j = 0; j < this.jointCount; ++j) {
      const from = frame * this.jointCount + j, to = next * this.jointCount + j;
      this.#a.fromArray(this.#rotations, 4 * from);
      this.#b.fromArray(this.#rotations, 4 * to);
      this.#a.slerp(this.#b, blend);
      for (let c = 0; c < 3; ++c) {
        const p = this.#positions[3 * from + c];
        this.#p.setComponent(c, p + blend * (this.#positions[3 * to + c] - p));
      }
      this.#matrix.compose(this.#p, this.#a, this.#one).toArray(pose, 16 * j);
    }
  }
}
