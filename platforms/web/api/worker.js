// Cloth in a Web Worker: the page's thread sends poses and receives vertices. The calls are those of the engine's own
// classes, as promises.
import { DClothError } from "./error.js";

/** @typedef {import("./engine.js").EngineOptions} EngineOptions */
/** @typedef {import("./cloth.js").ClothOptions} ClothOptions */
/** @typedef {import("./fit.js").Fit} Fit */

/**
 * A Web Worker, or a Worker of node:worker_threads.
 * @typedef {Object} WorkerLike
 * @property {(message: any, transfer?: any) => void} postMessage
 * @property {() => unknown} terminate
 */

/**
 * @typedef {EngineOptions & { worker?: WorkerLike }} WorkerOptions `worker`: one of your own, which runs worker_web.js;
 *   in Node a Worker of node:worker_threads, which runs worker_node.js
 */

/**
 * Starts a worker and loads the engine there. Errors: those of `loadEngine`, and Error where the worker does not start.
 * @param {WorkerOptions} [options]
 * @returns {Promise<ClothWorker>}
 */
export async function startWorker({ worker, ...options } = {}) {
  if (worker === undefined && typeof Worker === "undefined") {
    throw new Error("dcloth: there are no Web Workers here; mend: in Node give { worker: new Worker(path of " +
      "dcloth/worker_node.js) } of node:worker_threads");
  }
  const own = () => new Worker(new URL("./worker_web.js", import.meta.url), { type: "module" });
  const started = new ClothWorker(worker ?? own());
  /** @param {any} source */
  const told = (source) => (source instanceof URL || typeof source === "string" ? absolute(source) : source);
  try {
    const { version, instructionSet, fallback } = await started.call("load",
      { kernels: options.kernels, simd: told(options.simd), scalar: told(options.scalar) });
    started.version = version;
    started.instructionSet = instructionSet;
    started.fallback = fallback;
  } catch (error) {
    started.terminate();
    throw error;
  }
  return started;
}

/** An engine in a worker. Any number of models and cloths may live there; their updates run one after the other. */
export class ClothWorker {
  #worker;
  #next = 1;
  /** @type {Map<number, { resolve: (value: any) => void, reject: (error: Error) => void }>} */
  #waiting = new Map();
  /** @type {Error | null} */
  #ended = null;

  version = "";
  /** @type {"wasm" | "scalar"} see Engine.instructionSet */
  instructionSet = "wasm";
  /** Why the scalar module was taken, or "". */
  fallback = "";

  /**
   * Use startWorker.
   * @param {any} worker
   */
  constructor(worker) {
    this.#worker = worker;
    /** @param {any} event */
    const failed = (event) => this.#end(new Error(`dcloth: the worker failed: ${event?.message ?? "no message"}`));
    if (typeof worker.on === "function") {
      worker.on("message", (/** @type {any} */ data) => this.#receive(data));
      worker.on("error", failed);
      worker.on("exit", () => this.#end(new Error("dcloth: the worker has ended")));
    } else {
      worker.addEventListener("message", (/** @type {any} */ event) => this.#receive(event.data));
      worker.addEventListener("error", failed);
      worker.addEventListener("messageerror", failed);
    }
  }

  /**
   * Errors: DClothError with the engine's text.
   * @param {ArrayBuffer | ArrayBufferView} bytes a .dcloth file; copied
   * @param {string} [name] for messages
   */
  async openModel(bytes, name = "model") {
    return new WorkerModel(this, await this.call("openModel", { bytes, name }));
  }

  /**
   * The worker fetches and opens it.
   * @param {string | URL} url of a .dcloth file
   */
  async fetchModel(url) {
    return new WorkerModel(this, await this.call("fetchModel", { url: absolute(url) }));
  }

  /** Ends the worker with everything in it; calls that wait are refused. */
  terminate() {
    this.#end(new Error("dcloth: the worker was terminated"));
    this.#worker.terminate();
  }

  /**
   * For models and cloths.
   * @param {string} call
   * @param {object} args
   * @param {ArrayBuffer[]} [transfer]
   * @returns {Promise<any>}
   */
  call(call, args, transfer = []) {
    return new Promise((resolve, reject) => {
      if (this.#ended !== null) throw this.#ended;
      const id = this.#next++;
      this.#worker.postMessage({ id, call, args }, transfer);
      this.#waiting.set(id, { resolve, reject });
    });
  }

  /** @param {{ id: number, result?: any, error?: any }} message */
  #receive({ id, result, error }) {
    const waiting = this.#waiting.get(id);
    this.#waiting.delete(id);
    if (waiting === undefined) return;
    if (error === undefined) {
      waiting.resolve(result);
    } else if (error.status === undefined) {
      waiting.reject(new Error(error.message));
    } else {
      waiting.reject(new DClothError(error.status, error.message, error.offsetBytes));
    }
  }

  /** @param {Error} why */
  #end(why) {
    this.#ended ??= why;
    for (const { reject } of this.#waiting.values()) reject(this.#ended);
    this.#waiting.clear();
  }
}

/** A model in the worker, with what `Model` says of it. */
export class WorkerModel {
  /**
   * Use ClothWorker.openModel.
   * @param {ClothWorker} worker
   * @param {any} described
   */
  constructor(worker, described) {
    this.worker = worker;
    /** @type {number} in messages */
    this.id = described.id;
    /** @type {string} */
    this.name = described.name;
    /** @type {string} */
    this.precision = described.precision;
    /** @type {string} */
    this.format = described.format;
    /** @type {string[]} */
    this.jointNames = described.jointNames;
    /** @type {number[] | null} */
    this.jointParents = described.jointParents;
    /** @type {Float32Array} [jointCount, 16] */
    this.bindMatrices = described.bindMatrices;
    /** @type {number} */
    this.jointCount = described.jointCount;
    /** @type {number} */
    this.vertexCount = described.vertexCount;
    /** @type {number} */
    this.triangleCount = described.triangleCount;
    /** @type {Uint16Array} [triangleCount, 3] */
    this.triangles = described.triangles;
    /** @type {Float32Array} [texturedVertexCount, 2] */
    this.textureCoordinates = described.textureCoordinates;
    /** @type {Uint16Array} [triangleCount, 3] */
    this.texturedTriangles = described.texturedTriangles;
    /** @type {number} */
    this.texturedVertexCount = described.texturedVertexCount;
    /** @type {number} */
    this.stages = described.stages;
    /** @type {number} */
    this.tickSeconds = described.tickSeconds;
    /** @type {boolean} */
    this.hasBody = described.hasBody;
    /** @type {boolean} */
    this.readsWind = described.readsWind;
    /** @type {number} */
    this.clothBytes = described.clothBytes;
  }

  /**
   * Errors: those of Model.createCloth.
   * @param {ClothOptions} [options]
   */
  async createCloth(options = {}) {
    return new WorkerCloth(this, await this.worker.call("createCloth", { model: this.id, options }));
  }

  /** Its memory goes when the last of its cloths is disposed of too. */
  dispose() {
    return this.worker.call("dispose", { target: this.id });
  }
}

/**
 * One garment on one character, in the worker. Write joint matrices into `pose` and call update; when its promise is
 * fulfilled, `positions`, `normals`, `tangents` and `bounds` are those of that frame. They are plain memory of this
 * thread, and stay valid until the next frame arrives: take them anew from the cloth with each frame.
 */
export class WorkerCloth {
  #counts;
  /** Memory that no frame uses. @type {ArrayBuffer[]} */
  #spare = [];
  #shown;
  #inWork = 0;
  #jumped = false;

  /**
   * Use WorkerModel.createCloth.
   * @param {WorkerModel} model
   * @param {{ id: number, fit: Fit | null, counts: number[] }} made
   */
  constructor(model, { id, fit, counts }) {
    this.model = model;
    this.id = id;
    /** How the garment fits the character of the options, or null. */
    this.fit = fit;
    /** [jointCount, 16] joint to world, to be written before update; always the same array. */
    this.pose = new Float32Array(counts[0]);
    /** Which stages run from now on. */
    this.stages = model.stages;
    /** FrameFlags of every update from now on. */
    this.flags = 0;
    /** Keeps vertices outside of the posed body, where the model has one. */
    this.outsideBody = false;
    /** false: motion goes on, vertices stay. */
    this.visible = true;
    this.#counts = counts;
    this.#shown = new ArrayBuffer(4 * counts.reduce((sum, count) => sum + count, 0));
    const [positions, normals, tangents, bounds] = this.#views();
    /** [vertexCount, 3] of the last frame that arrived; zeros before the first. */
    this.positions = positions;
    /** [vertexCount, 3] unit length, outward; empty where not asked for. */
    this.normals = normals;
    /** [vertexCount, 4]; empty without uv. */
    this.tangents = tangents;
    /** [6] least x, y, z, then greatest. */
    this.bounds = bounds;
  }

  /** An update has not come back yet. Skip the frame and add its seconds to the next: updates then never pile up. */
  get busy() {
    return this.#inWork !== 0;
  }

  /**
   * One frame. The pose is copied, so it may be written again at once. Errors: DClothError POSE, ARGUMENT; the cloth is
   * then as it was.
   * @param {number} seconds since the last one, 0 or more
   * @returns {Promise<WorkerCloth>} this
   */
  async update(seconds) {
    const memory = this.#spare.pop() ?? new ArrayBuffer(this.#shown.byteLength);
    new Float32Array(memory, 0, this.#counts[0]).set(this.pose);
    const { id, stages, flags, outsideBody, visible } = this;
    const args = { cloth: id, memory, seconds, stages, flags, outsideBody, visible, jumped: this.#jumped };
    this.#jumped = false;
    ++this.#inWork;
    try {
      const drawn = await this.model.worker.call("update", args, [memory]);
      if (visible) {
        this.#spare.push(this.#shown);
        this.#shown = drawn;
        [this.positions, this.normals, this.tangents, this.bounds] = this.#views();
      } else {
        this.#spare.push(drawn);
      }
    } finally {
      --this.#inWork;
    }
    return this;
  }

  /** The character is moved without motion before the next update (a portal): the cloth hangs as before. */
  jump() {
    this.#jumped = true;
  }

  /** Forgets all motion before the next update: a cut, a spawn. */
  reset() {
    this.#jumped = false;
    return this.#call("reset");
  }

  /**
   * See Cloth.setWind.
   * @param {number} x
   * @param {number} y
   * @param {number} z
   */
  setWind(x, y, z) {
    return this.#call("setWind", [x, y, z]);
  }

  /** See Cloth.takeBindPose: `pose` holds the bind pose. */
  takeBindPose() {
    return this.#call("takeBindPose", [], this.pose);
  }

  /** @returns {Promise<Uint8Array>} all that the frames to come depend on */
  save() {
    return this.#call("save");
  }

  /**
   * @param {Uint8Array} state from save
   * @param {{ otherModel?: boolean }} [options]
   */
  restore(state, options = {}) {
    return this.#call("restore", [state, options]);
  }

  /** Gives the worker's memory back. */
  dispose() {
    this.#spare = [];
    return this.model.worker.call("dispose", { target: this.id });
  }

  /**
   * @param {string} method
   * @param {any[]} [values]
   * @param {Float32Array} [pose]
   */
  #call(method, values = [], pose = undefined) {
    return this.model.worker.call("cloth", { cloth: this.id, method, values, pose });
  }

  /** Behind the pose: positions, normals, tangents, bounds. */
  #views() {
    let at = 4 * this.#counts[0];
    return this.#counts.slice(1).map((count) => {
      const view = new Float32Array(this.#shown, at, count);
      at += 4 * count;
      return view;
    });
  }
}

/**
 * As the page sees it: the worker's own address is another one.
 * @param {string | URL} url
 */
function absolute(url) {
  const page = globalThis.location?.href;
  return page === undefined ? String(url) : new URL(url, page).href;
}
