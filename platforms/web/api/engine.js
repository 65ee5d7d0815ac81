import * as abi from "./abi.js";
import { Memory } from "./memory.js";
import { Model } from "./model.js";
import { Scene } from "./scene.js";
import { hasSimd } from "./simd.js";
import { Timer } from "./timer.js";

/**
 * What a module may come from.
 * @typedef {string | URL | Response | ArrayBufferView | ArrayBuffer | WebAssembly.Module} ModuleSource
 */

/**
 * @typedef {Object} EngineOptions
 * @property {"auto" | "simd" | "scalar"} [kernels] "auto": SIMD where the browser has it, else scalar. "simd" fails
 *   without it.
 * @property {ModuleSource} [simd] dcloth.wasm; where it is not beside this file
 * @property {ModuleSource} [scalar] dcloth-scalar.wasm
 */

/**
 * The engine in one WebAssembly instance with one memory. Everything it makes lives in that memory until dispose().
 * One thread: a worker loads an engine of its own.
 */
export class Engine {
  /**
   * @param {abi.Exports} exports
   * @param {string} fallback
   */
  constructor(exports, fallback) {
    this.exports = exports;
    this.memory = new Memory(exports);
    this.version = this.memory.text(exports.dcloth_version());
    /** @type {"wasm" | "scalar"} what the kernels run on; "scalar" is about ten times slower */
    this.instructionSet = /** @type {"wasm" | "scalar"} */ (this.memory.text(exports.dcloth_isa_name()));
    /** Why the scalar module was taken, or "" where SIMD runs. Worth telling the user. */
    this.fallback = fallback;
    this.clock = exports.dcloth_web_clock_address();
  }

  /**
   * Copies a model's bytes into the module's memory and checks them. Errors: DClothError with the engine's text.
   * @param {ArrayBuffer | ArrayBufferView} bytes a .dcloth file
   * @param {string} [name] for messages
   */
  openModel(bytes, name = "model") {
    return new Model(this, bytes, name);
  }

  /**
   * @param {string | URL} url of a .dcloth file
   * @returns {Promise<Model>}
   */
  async fetchModel(url) {
    return this.openModel(await (await fetchOk(url)).arrayBuffer(), String(url));
  }

  /** For Cloth.timer. */
  createTimer() {
    return new Timer(this);
  }

  /**
   * Places for up to `characterCount` characters that share a budget.
   * @param {number} characterCount 1 to 65536
   */
  createScene(characterCount) {
    return new Scene(this, characterCount);
  }
}

/**
 * Loads the engine. Errors: those of fetch and WebAssembly; Error where the module is not what it should be.
 * @param {EngineOptions} [options]
 * @returns {Promise<Engine>}
 */
export async function loadEngine(options = {}) {
  const wanted = options.kernels ?? "auto";
  if (!["auto", "simd", "scalar"].includes(wanted)) {
    throw new Error(`dcloth: kernels '${wanted}'; allowed: auto, simd, scalar`);
  }
  const simd = wanted === "simd" || (wanted === "auto" && hasSimd());
  if (wanted === "simd" && !hasSimd()) {
    throw new Error("dcloth: this browser has no WebAssembly SIMD; mend: a newer browser, or kernels: 'auto'");
  }
  const source = simd
    ? (options.simd ?? new URL("./dcloth.wasm", import.meta.url))
    : (options.scalar ?? new URL("./dcloth-scalar.wasm", import.meta.url));
  const imports = {
    dcloth: { now_microseconds: () => 1000 * performance.now() },
    // A module that grows its memory tells so; views are renewed where they are used.
    env: { emscripten_notify_memory_growth() {} },
  };
  const instance = await instantiate(source, imports);
  const exports = /** @type {abi.Exports} */ (/** @type {unknown} */ (instance.exports));
  /** @type {any} */ (instance.exports)._initialize?.();
  let fallback = "";
  if (!simd) fallback = wanted === "scalar" ? "asked for" : "this browser has no WebAssembly SIMD";
  const engine = new Engine(exports, fallback);
  const expected = simd ? "wasm" : "scalar";
  if (engine.instructionSet !== expected) {
    throw new Error(`dcloth: ${source} runs ${engine.instructionSet} kernels; expected: ${expected}; ` +
      "mend: build it with scripts/build_web.sh");
  }
  return engine;
}

/** @param {string | URL} url */
async function fetchOk(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`dcloth: ${url}: ${response.status} ${response.statusText}`);
  return response;
}

/**
 * @param {ModuleSource} source
 * @param {WebAssembly.Imports} imports
 */
async function instantiate(source, imports) {
  if (source instanceof WebAssembly.Module) return WebAssembly.instantiate(source, imports);
  const isUrl = typeof source === "string" || source instanceof URL;
  const loaded = isUrl ? await fetchOk(source) : source;
  const bytes = typeof Response !== "undefined" && loaded instanceof Response ? await loaded.arrayBuffer() : loaded;
  const { instance } = await WebAssembly.instantiate(/** @type {BufferSource} */ (bytes), imports);
  return instance;
}
