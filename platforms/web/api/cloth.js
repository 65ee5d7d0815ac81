import * as abi from "./abi.js";
import { DClothError, throwUnlessOk } from "./error.js";
import { fitCloth } from "./fit.js";

/** @typedef {import("./model.js").Model} Model */
/** @typedef {import("./timer.js").Timer} Timer */
/** @typedef {import("./fit.js").Character} Character */
/** @typedef {import("./fit.js").Fit} Fit */

/**
 * The host's axes and unit; see dcloth_space. Without it: left +X, up +Y, forward +Z, metres, as in glTF and three.js.
 * @typedef {Object} Space
 * @property {number} left one of Axis
 * @property {number} up
 * @property {number} forward
 * @property {number} [metresPerUnit] 1 where not said
 * @property {boolean} [jointFramesKept] joints keep the axes of training, only the world is turned
 */

/**
 * @typedef {Object} ClothOptions
 * @property {readonly string[]} [jointNames] the host's skeleton; poses then hold one matrix per name
 * @property {Character} [character] the garment is fitted to it, in place of jointNames; `Cloth.fit` says how it fits
 * @property {Space} [space]
 * @property {boolean} [rowMajor] rows of matrices are contiguous; three.js has columns
 * @property {boolean} [normals] true where not said
 * @property {boolean} [textured] draws the vertices of `Model.textureCoordinates`
 * @property {ArrayLike<number>} [uv] [vertexCount, 2], or [texturedVertexCount, 2]; asks for tangents
 */

const MATRIX_FLOATS = 16;
const BOUNDS_FLOATS = 6;
const STRUCTS = [abi.dcloth_pose, abi.dcloth_frame, abi.dcloth_output, abi.dcloth_cloth_info];

/**
 * One garment on one character. Write joint matrices into `pose`, call update, draw `positions` and `normals`.
 * Thread: the engine's. Errors: DClothError; a refused call leaves state and vertices as they were. Cost: update makes
 * no garbage while the module's memory does not grow.
 */
export class Cloth {
  #engine;
  #storage;
  #fitStorage = 0;
  #block;
  // Addresses of the structs.
  #pose = 0;
  #frame = 0;
  #output = 0;
  #info = 0;
  #normals = false;
  #textured = false;
  #jumped = false;
  #held = false;
  /** @type {{ start: number, floats: number, view: Float32Array }[]} */
  #views = [];

  /**
   * Use Model.createCloth.
   * @param {Model} model
   * @param {ClothOptions} [options]
   */
  constructor(model, options = {}) {
    const { engine } = model;
    const { memory, exports } = engine;
    const normals = options.normals ?? true;
    const { uv } = options;
    const n = options.textured ? model.texturedVertexCount : model.vertexCount;
    if (n === 0) throw new Error(`dcloth: ${model.name} holds no texture coordinates; leave out "textured"`);
    if (uv !== undefined && (uv.length !== 2 * n || !normals)) {
      throw new Error(`dcloth: ${model.name}: ${uv.length} texture coordinates; allowed: ${2 * n}, ` +
        "u and v of each vertex, and with normals");
    }
    model.retain();
    this.#held = true;
    this.#normals = normals;
    this.model = model;
    this.#engine = engine;
    this.#storage = 0;
    this.#block = 0;
    this.address = 0;
    this.jointCount = (options.character ?? options).jointNames?.length ?? model.jointCount;
    /** @type {Fit | null} how the garment fits the character of the options */
    this.fit = null;
    /** Of `positions` and `normals`. */
    this.vertexCount = n;
    this.#textured = options.textured ?? false;
    const coarse = model.coarseVertices;
    const floats = [this.jointCount * MATRIX_FLOATS, 3 * n, normals ? 3 * n : 0, uv ? 4 * n : 0, BOUNDS_FLOATS,
      uv ? 2 * n : 0, 3, uv ? 2 * coarse.length : 0];
    const structBytes = STRUCTS.reduce((sum, struct) => sum + round16(struct.bytes), 0);
    try {
      this.#storage = memory.lend(model.clothBytes);
      memory.withBlock(4, (result) => {
        memory.check(model.name, (error) =>
          exports.dcloth_cloth_create(model.address, this.#storage, model.clothBytes, result, error));
        this.address = memory.u32[result / 4];
      });
      this.#block = memory.lend(structBytes + floats.reduce((sum, count) => sum + round16(4 * count), 0));
      if (options.jointNames && !options.character) this.#bindJoints(options.jointNames);
      if (options.space) this.#setSpace(options.space);
      if (options.character) {
        const fitted = fitCloth(model, this.address, options.character, !options.rowMajor);
        this.fit = fitted.fit;
        this.#fitStorage = fitted.storage;
      }
    } catch (error) {
      this.dispose();
      throw error;
    }
    let at = this.#block;
    /** @param {number} bytes */
    const take = (bytes) => {
      const start = at;
      at += round16(bytes);
      return start;
    };
    [this.#pose, this.#frame, this.#output, this.#info] = STRUCTS.map((struct) => take(struct.bytes));
    this.#views = floats.map((count) => ({ start: take(4 * count), floats: count, view: new Float32Array(0) }));
    if (uv) {
      this.#view(5).set(uv);
      coarse.forEach((vertex, i) => this.#view(7).set([uv[2 * vertex], uv[2 * vertex + 1]], 2 * i));
    }

    /** Which stages run from now on, DCLOTH_STAGES_* of `Stages`. */
    this.stages = model.stages;
    /** FrameFlags of every update from now on. */
    this.flags = 0;
    /** Keeps vertices outside of the posed body, where the model has one. */
    this.outsideBody = false;
    /** false: motion goes on, vertices stay. */
    this.visible = true;
    /** @type {Timer | null} what steps take is added to it */
    this.timer = null;
    /** Of the last describe(). */
    this.info = new ClothInfo(memory, this.#info);
    this.#fillStructs(options.rowMajor ? 0 : 1);
  }

  /** [jointCount, 16] joint to world, to be written before update. The array is another one after memory has grown. */
  get pose() {
    return this.#view(0);
  }
  /**
   * For a rig whose joints have axes or scale of their own: `pose` holds its bind pose, the body as and where that of
   * training stood. Throws POSE with the joint that has no inverse.
   */
  takeBindPose() {
    this.#checkAlive("dcloth_cloth_set_bind_pose");
    const { exports, memory } = this.#engine;
    memory.check(this.model.name, (error) =>
      exports.dcloth_cloth_set_bind_pose(this.address, this.#pose, error));
  }

  /**
   * The wind from now on, in the host's units a second along its axes, at most 100 m/s. Models without `readsWind`
   * ignore it.
   * @param {number} x
   * @param {number} y
   * @param {number} z
   */
  setWind(x, y, z) {
    this.#checkAlive("dcloth_cloth_set_wind");
    const wind = this.#view(6);
    wind[0] = x;
    wind[1] = y;
    wind[2] = z;
    throwUnlessOk(this.#engine.exports.dcloth_cloth_set_wind(this.address, wind.byteOffset, 0),
        "dcloth_cloth_set_wind");
  }

  /** [vertexCount, 3] of the last frame drawn, in the engine's memory: for a GPU upload without a copy. The array is
   * another one after memory has grown; take it anew for each frame. After Draw.COARSE it begins with the coarse mesh's
   * vertices, as normals and tangents do. */
  get positions() {
    return this.#view(1);
  }
  /** [vertexCount, 3] unit length, outward; empty where not asked for. */
  get normals() {
    return this.#view(2);
  }
  /** [vertexCount, 4]; empty without uv. */
  get tangents() {
    return this.#view(3);
  }
  /** [6] least x, y, z, then greatest. */
  get bounds() {
    return this.#view(4);
  }

  /**
   * One frame: runs the ticks that are due and draws.
   * @param {number} seconds since the last one, 0 or more
   * @param {number} [stages]
   * @param {number} [flags] FrameFlags
   * @param {number} [draw] one of Draw; the coarse mesh is not kept outside of the body
   */
  update(seconds, stages = this.stages, flags = this.flags, draw = abi.DCLOTH_DRAW_FULL) {
    this.#checkAlive("dcloth_cloth_update");
    const { exports, memory } = this.#engine;
    const frame = this.#frame;
    memory.u32[(frame + abi.dcloth_frame.stages) / 4] = stages;
    memory.f32[(frame + abi.dcloth_frame.seconds) / 4] = seconds;
    memory.u32[(frame + abi.dcloth_frame.flags) / 4] = flags | (this.#jumped ? abi.DCLOTH_FRAME_JUMPED : 0);
    const output = this.visible && draw !== abi.DCLOTH_DRAW_NONE ? this.#prepareOutput(draw) : 0;
    throwUnlessOk(exports.dcloth_cloth_update(this.address, this.#pose, frame, output, this.timer?.address ?? 0),
      "dcloth_cloth_update");
    this.#jumped = false;
  }

  /**
   * One tick of the network, for hosts with a clock of their own; then skin.
   * @param {number} [stages]
   */
  tick(stages = this.stages) {
    throwUnlessOk(this.#engine.exports.dcloth_cloth_tick(this.address, this.#pose, stages, this.timer?.address ?? 0),
      "dcloth_cloth_tick");
  }

  /** @param {number} blend 0: the tick before the last one, 1: the last one */
  skin(blend) {
    this.#checkAlive("dcloth_cloth_skin");
    const output = this.#prepareOutput(abi.DCLOTH_DRAW_FULL);
    throwUnlessOk(
      this.#engine.exports.dcloth_cloth_skin(this.address, this.#pose, blend, output, this.timer?.address ?? 0),
      "dcloth_cloth_skin");
  }

  /** The character is moved without motion before the next update (a portal): the cloth hangs as before. */
  jump() {
    this.#jumped = true;
  }

  /** Forgets all motion before the next update: a cut, a spawn. */
  reset() {
    throwUnlessOk(this.#engine.exports.dcloth_cloth_reset(this.address), "dcloth_cloth_reset");
    this.#jumped = false;
  }

  /** What the last update did; the object is the same each time. */
  describe() {
    const { exports } = this.#engine;
    throwUnlessOk(exports.dcloth_cloth_describe(this.address, this.#info), "dcloth_cloth_describe");
    return this.info;
  }

  /** All that the frames to come depend on; joint names, space and wind are not among it. */
  save() {
    const { exports, memory } = this.#engine;
    const size = exports.dcloth_cloth_state_size(this.address);
    return memory.withBlock(size, (state) => {
      memory.check(this.model.name, (error) => exports.dcloth_cloth_save(this.address, state, size, error));
      return memory.u8.slice(state, state + size);
    });
  }

  /**
   * Errors: DClothError FORMAT, VERSION, MODEL, SEMANTICS; the cloth is then as it was.
   * @param {Uint8Array} state from save
   * @param {{ otherModel?: boolean }} [options] takes the state of another file with the same sizes
   */
  restore(state, options = {}) {
    const { exports, memory } = this.#engine;
    const flags = options.otherModel ? abi.DCLOTH_RESTORE_OTHER_MODEL : 0;
    memory.withBlock(state.length, (at) => {
      memory.u8.set(state, at);
      memory.check(this.model.name, (error) =>
        exports.dcloth_cloth_restore(this.address, at, state.length, flags, error));
    });
  }

  /** Gives the memory back; take it out of scenes before. */
  dispose() {
    const { memory } = this.#engine;
    if (this.#block !== 0) memory.giveBack(this.#block);
    if (this.#storage !== 0) memory.giveBack(this.#storage);
    if (this.#fitStorage !== 0) memory.giveBack(this.#fitStorage);
    if (this.#held) this.model.release();
    this.#held = false;
    this.#block = this.#storage = this.#fitStorage = this.address = 0;
    this.#views = [];
  }

  /** @param {number} index */
  #view(index) {
    const entry = this.#views[index];
    if (entry === undefined) throw new Error(`dcloth: this cloth of ${this.model.name} was disposed of`);
    if (entry.view.buffer !== this.#engine.memory.buffer) {
      entry.view = new Float32Array(/** @type {ArrayBuffer} */ (this.#engine.memory.buffer), entry.start, entry.floats);
    }
    return entry.view;
  }

  /**
   * Before the structs are written: their memory may be another cloth's by now.
   * @param {string} call
   */
  #checkAlive(call) {
    if (this.address !== 0) return;
    throw new DClothError(abi.DCLOTH_ERROR_ARGUMENT, `${call}: this cloth of ${this.model.name} was disposed of`);
  }

  /** @param {number} draw */
  #prepareOutput(draw) {
    const { u32 } = this.#engine.memory;
    const o = abi.dcloth_output;
    const coarse = draw === abi.DCLOTH_DRAW_COARSE;
    const positionsAlone = draw === abi.DCLOTH_DRAW_POSITIONS;
    const tangents = this.#views[3].floats !== 0 && !positionsAlone;
    u32[(this.#output + o.flags) / 4] = coarse ? abi.DCLOTH_OUTPUT_COARSE
      : (this.outsideBody && draw !== abi.DCLOTH_DRAW_PLAIN ? abi.DCLOTH_OUTPUT_OUTSIDE_BODY : 0) |
        (this.#textured ? abi.DCLOTH_OUTPUT_TEXTURED : 0);
    u32[(this.#output + o.vertex_count) / 4] = coarse ? this.model.coarseVertices.length : this.vertexCount;
    u32[(this.#output + o.normals) / 4] = this.#normals && !positionsAlone ? this.#views[2].start : 0;
    u32[(this.#output + o.tangents) / 4] = tangents ? this.#views[3].start : 0;
    u32[(this.#output + o.texture_coordinates) / 4] = tangents ? this.#views[coarse ? 7 : 5].start : 0;
    return this.#output;
  }

  /**
   * What stays the same from frame to frame.
   * @param {number} columnMajor
   */
  #fillStructs(columnMajor) {
    const { u32 } = this.#engine.memory;
    /** @type {(at: number, offset: number, value: number) => void} */
    const put = (at, offset, value) => {
      u32[(at + offset) / 4] = value;
    };
    const [pose, positions, , , bounds] = this.#views.map((entry) => entry.start);
    const p = abi.dcloth_pose;
    put(this.#pose, p.struct_size, p.bytes);
    put(this.#pose, p.joint_count, this.jointCount);
    put(this.#pose, p.joint_matrices, pose);
    put(this.#pose, p.column_major, columnMajor);
    put(this.#frame, abi.dcloth_frame.struct_size, abi.dcloth_frame.bytes);
    put(this.#frame, abi.dcloth_frame.error, 0);
    put(this.#info, abi.dcloth_cloth_info.struct_size, abi.dcloth_cloth_info.bytes);
    const o = abi.dcloth_output;
    put(this.#output, o.struct_size, o.bytes);
    put(this.#output, o.positions, positions);
    put(this.#output, o.position_stride_bytes, 12);
    put(this.#output, o.bounds, bounds);
    put(this.#output, o.normal_stride_bytes, 12);
    put(this.#output, o.tangent_stride_bytes, 16);
    put(this.#output, o.texture_stride_bytes, 8);
  }

  /** @param {readonly string[]} names */
  #bindJoints(names) {
    const { exports, memory } = this.#engine;
    memory.withNames(names, (table) => {
      memory.check(this.model.name, (error) =>
        exports.dcloth_cloth_bind_joints(this.address, table, names.length, error));
    });
  }

  /** @param {Space} space */
  #setSpace(space) {
    const { exports, memory } = this.#engine;
    const layout = abi.dcloth_space;
    memory.withBlock(layout.bytes, (at) => {
      const { u32, f32 } = memory;
      u32[(at + layout.struct_size) / 4] = layout.bytes;
      u32[(at + layout.left) / 4] = space.left;
      u32[(at + layout.up) / 4] = space.up;
      u32[(at + layout.forward) / 4] = space.forward;
      f32[(at + layout.metres_per_unit) / 4] = space.metresPerUnit ?? 1;
      u32[(at + layout.joint_frames) / 4] =
        space.jointFramesKept ? abi.DCLOTH_JOINT_FRAMES_KEPT : abi.DCLOTH_JOINT_FRAMES_CONVERTED;
      memory.check(this.model.name, (error) => exports.dcloth_cloth_set_space(this.address, at, error));
    });
  }
}

/** What the last update did, as of the last describe(); read where the engine wrote it. */
export class ClothInfo {
  #memory;
  #at;

  /** @param {import("./memory.js").Memory} memory @param {number} at */
  constructor(memory, at) {
    this.#memory = memory;
    this.#at = at / 4;
  }

  /** A tick is begun and not complete. */
  get inWork() {
    return this.#memory.u32[this.#at + abi.dcloth_cloth_info.in_work / 4] !== 0;
  }
  /** By how much the displacement drawn is older than the pose. */
  get lagSeconds() {
    return this.#memory.f32[this.#at + abi.dcloth_cloth_info.lag_seconds / 4];
  }
  /** Network work in ticks; 1 is a whole tick of all stages. */
  get tickShare() {
    return this.#memory.f32[this.#at + abi.dcloth_cloth_info.tick_share / 4];
  }
  /** FrameFlags.FREEZE_IDLE lets ticks rest. */
  get frozen() {
    return this.#memory.u32[this.#at + abi.dcloth_cloth_info.frozen / 4] !== 0;
  }
  /** The next frame with time has a tick, however short it is. */
  get tickWaits() {
    return this.#memory.u32[this.#at + abi.dcloth_cloth_info.tick_waits / 4] !== 0;
  }
}

/** @param {number} bytes */
function round16(bytes) {
  return Math.ceil(bytes / 16) * 16;
}
