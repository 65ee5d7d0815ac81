import * as abi from "./abi.js";

/** @typedef {import("./engine.js").Engine} Engine */

/** The steps of an update, in the order of DCLOTH_STEP_*. */
export const STEPS = Object.freeze(
  ["pose", "static", "skeleton", "mesh", "displacement", "skinning", "normals", "penetration"]);

/** Adds up what each step takes, by performance.now(), whose grain is 5 to 1000 us: sum over many frames. */
export class Timer {
  #engine;

  /** @param {Engine} engine */
  constructor(engine) {
    this.#engine = engine;
    const layout = abi.dcloth_timer;
    this.address = engine.memory.lend(layout.bytes);
    engine.memory.u32[(this.address + layout.struct_size) / 4] = layout.bytes;
    engine.memory.u32[(this.address + layout.now) / 4] = engine.clock;
  }

  /** @param {number} step DCLOTH_STEP_* */
  microseconds(step) {
    const at = (this.address + abi.dcloth_timer.elapsed) / 4 + 2 * step;
    const { u32 } = this.#engine.memory;
    return u32[at] + 4294967296 * u32[at + 1];
  }

  reset() {
    const start = (this.address + abi.dcloth_timer.elapsed) / 4;
    this.#engine.memory.u32.fill(0, start, start + 2 * abi.DCLOTH_STEP_COUNT);
  }

  /** After the cloths that hold it let go. */
  dispose() {
    if (this.address !== 0) this.#engine.memory.giveBack(this.address);
    this.address = 0;
  }
}
