import * as abi from "./abi.js";
import { throwUnlessOk } from "./error.js";

/** @typedef {import("./engine.js").Engine} Engine */
/** @typedef {import("./cloth.js").Cloth} Cloth */

/**
 * What a character costs on this machine and how far off each level looks; arrays in the order of Levels.
 * @typedef {Object} Character
 * @property {Cloth} cloth
 * @property {number} importance 0 or more, say the share of the screen; 0 stays frozen
 * @property {number} drawMicroseconds of a frame without a tick
 * @property {ArrayLike<number>} tickMicroseconds of one tick at each level
 * @property {ArrayLike<number>} errorMm
 * @property {number} [topLevel] no higher one is wanted
 * @property {number} [positionsMicroseconds] of a frame without a tick that draws positions alone; not said: never so
 * @property {number} [plainMicroseconds] of one that is not kept outside of the body; not said: never so
 * @property {number} [coarseMicroseconds] of one that draws the coarse mesh with its normals; not said: never so
 * @property {number} [undrawnMicroseconds] of one that draws nothing; 0 where not said
 * @property {number} [mostUndrawn] frames in a row that may pass undrawn; 0 where not said
 */

/**
 * Many characters in one budget. Every frame: plan, then update each cloth with stages(i), flags(i) and draw(i).
 * Errors: DClothError. Cost: plan and update make no garbage.
 */
export class Scene {
  #engine;
  #storage = 0;
  #block = 0;
  #scene = 0;
  /** @type {(Cloth | null)[]} */
  #cloths;

  /**
   * Use Engine.createScene.
   * @param {Engine} engine
   * @param {number} characterCount
   */
  constructor(engine, characterCount) {
    const { memory, exports } = engine;
    this.#engine = engine;
    this.characterCount = characterCount;
    this.#cloths = new Array(characterCount).fill(null);
    const size = exports.dcloth_scene_storage_size(characterCount);
    try {
      this.#storage = memory.lend(size);
      // The choice of one character after the other, the frame before them, the planned cost before that.
      this.#block = memory.lend(16 + abi.dcloth_scene_frame.bytes + abi.dcloth_scene_choice.bytes * characterCount);
      memory.withBlock(4, (result) => {
        memory.check("scene", (error) =>
          exports.dcloth_scene_create(characterCount, this.#storage, size, result, error));
        this.#scene = memory.u32[result / 4];
      });
    } catch (error) {
      this.dispose();
      throw error;
    }
    memory.u32[this.#frame / 4] = abi.dcloth_scene_frame.bytes;
    for (let i = 0; i < characterCount; ++i) memory.u32[this.#choice(i) / 4] = abi.dcloth_scene_choice.bytes;
  }

  /**
   * Puts a character into a slot, as one that was never ticked; null empties it.
   * @param {number} index
   * @param {Character | null} character
   */
  set(index, character) {
    const { exports, memory } = this.#engine;
    const layout = abi.dcloth_scene_character;
    memory.withBlock(layout.bytes, (at) => {
      if (character) {
        const { u32, f32 } = memory;
        u32[(at + layout.struct_size) / 4] = layout.bytes;
        u32[(at + layout.top_level) / 4] = character.topLevel ?? abi.DCLOTH_LEVEL_MESH;
        u32[(at + layout.cloth) / 4] = character.cloth.address;
        f32[(at + layout.importance) / 4] = character.importance;
        f32[(at + layout.draw_microseconds) / 4] = character.drawMicroseconds;
        f32[(at + layout.positions_microseconds) / 4] = character.positionsMicroseconds ?? 0;
        f32[(at + layout.plain_microseconds) / 4] = character.plainMicroseconds ?? 0;
        f32[(at + layout.coarse_microseconds) / 4] = character.coarseMicroseconds ?? 0;
        f32[(at + layout.undrawn_microseconds) / 4] = character.undrawnMicroseconds ?? 0;
        u32[(at + layout.most_undrawn) / 4] = character.mostUndrawn ?? 0;
        for (let level = 0; level < abi.DCLOTH_LEVEL_COUNT; ++level) {
          f32[(at + layout.tick_microseconds) / 4 + level] = character.tickMicroseconds[level];
          f32[(at + layout.error_mm) / 4 + level] = character.errorMm[level];
        }
      }
      throwUnlessOk(exports.dcloth_scene_set(this.#scene, index, character ? at : 0), "dcloth_scene_set");
    });
    this.#cloths[index] = character?.cloth ?? null;
  }

  /**
   * @param {number} index
   * @param {number} importance
   */
  setImportance(index, importance) {
    throwUnlessOk(this.#engine.exports.dcloth_scene_set_importance(this.#scene, index, importance),
      "dcloth_scene_set_importance");
  }

  /**
   * Plans a frame.
   * @param {number} seconds the frame time that the updates will be given
   * @param {number} budgetMicroseconds for all updates of the frame together
   * @param {number} [spentMicroseconds] what the last plan's updates really took
   */
  plan(seconds, budgetMicroseconds, spentMicroseconds = 0) {
    const { exports, memory } = this.#engine;
    const layout = abi.dcloth_scene_frame;
    memory.f32[(this.#frame + layout.seconds) / 4] = seconds;
    memory.f32[(this.#frame + layout.budget_microseconds) / 4] = budgetMicroseconds;
    memory.f32[(this.#frame + layout.spent_microseconds) / 4] = spentMicroseconds;
    throwUnlessOk(exports.dcloth_scene_plan(this.#scene, this.#frame, this.#block), "dcloth_scene_plan");
    for (let i = 0; i < this.characterCount; ++i) {
      if (this.#cloths[i] === null) continue;
      throwUnlessOk(exports.dcloth_scene_get(this.#scene, i, this.#choice(i)), "dcloth_scene_get");
    }
  }

  /** What the last plan costs, by the costs given. */
  get plannedMicroseconds() {
    return this.#engine.memory.f32[this.#block / 4];
  }

  /** Of the last plan: one of Levels. @param {number} index */
  level(index) {
    return this.#word(index, abi.dcloth_scene_choice.level);
  }
  /** For Cloth.update. @param {number} index */
  stages(index) {
    return this.#word(index, abi.dcloth_scene_choice.stages);
  }
  /** For Cloth.update. @param {number} index */
  flags(index) {
    return this.#word(index, abi.dcloth_scene_choice.flags);
  }
  /** For Cloth.update, one of Draw. @param {number} index */
  draw(index) {
    return this.#word(index, abi.dcloth_scene_choice.draw);
  }
  /** That the frame runs. @param {number} index */
  ticks(index) {
    return this.#word(index, abi.dcloth_scene_choice.ticks);
  }
  /** Since it was last given a tick. @param {number} index */
  staleSeconds(index) {
    return this.#engine.memory.f32[(this.#choice(index) + abi.dcloth_scene_choice.stale_seconds) / 4];
  }

  /** Before the cloths in it. */
  dispose() {
    const { memory } = this.#engine;
    if (this.#block !== 0) memory.giveBack(this.#block);
    if (this.#storage !== 0) memory.giveBack(this.#storage);
    this.#storage = this.#block = this.#scene = 0;
    this.#cloths.fill(null);
  }

  get #frame() {
    return this.#block + 16;
  }
  /** @param {number} index */
  #choice(index) {
    if (this.#cloths[index] === undefined) {
      throw new RangeError(`dcloth: character ${index} of a scene of ${this.characterCount}`);
    }
    return this.#block + 16 + abi.dcloth_scene_frame.bytes + abi.dcloth_scene_choice.bytes * index;
  }
  /** @type {(index: number, offset: number) => number} */
  #word(index, offset) {
    return this.#engine.memory.u32[(this.#choice(index) + offset) / 4];
  }
}
