import * as abi from "./abi.js";
import { DClothError } from "./error.js";

const UTF8 = new TextDecoder();
const TO_UTF8 = new TextEncoder();

/**
 * The module's memory: numbers in it, and blocks lent to the engine. Growing gives it another ArrayBuffer, and all
 * views of the old one become empty; hence the check before each access, which makes a view only then.
 */
export class Memory {
  /** @param {abi.Exports} exports */
  constructor(exports) {
    this.exports = exports;
    /** Blocks that are lent; 0 after everything was disposed of. */
    this.blockCount = 0;
    this.#renew();
  }

  /** @type {ArrayBufferLike} */ #buffer = new ArrayBuffer(0);
  #u8 = new Uint8Array();
  #u32 = new Uint32Array();
  #f32 = new Float32Array();
  #u64 = new BigUint64Array();

  #renew() {
    const buffer = this.exports.memory.buffer;
    this.#buffer = buffer;
    this.#u8 = new Uint8Array(buffer);
    this.#u32 = new Uint32Array(buffer);
    this.#f32 = new Float32Array(buffer);
    this.#u64 = new BigUint64Array(buffer);
  }

  /** Another object after the memory has grown. */
  get buffer() {
    return this.exports.memory.buffer;
  }
  get u8() {
    if (this.#buffer !== this.exports.memory.buffer) this.#renew();
    return this.#u8;
  }
  /** Index: address / 4. */
  get u32() {
    if (this.#buffer !== this.exports.memory.buffer) this.#renew();
    return this.#u32;
  }
  get f32() {
    if (this.#buffer !== this.exports.memory.buffer) this.#renew();
    return this.#f32;
  }
  /** Index: address / 8. */
  get u64() {
    if (this.#buffer !== this.exports.memory.buffer) this.#renew();
    return this.#u64;
  }

  /**
   * Zeroed bytes on a multiple of DCLOTH_ALIGNMENT. Errors: DClothError MEMORY.
   * @param {number} size
   */
  lend(size) {
    const rounded = Math.max(1, Math.ceil(size / abi.DCLOTH_ALIGNMENT)) * abi.DCLOTH_ALIGNMENT;
    const address = this.exports.aligned_alloc(abi.DCLOTH_ALIGNMENT, rounded) >>> 0;
    if (address === 0) {
      const text = `${rounded} bytes do not fit into the module's memory of ${this.buffer.byteLength} bytes, ` +
        "which may grow to 2 GB where the browser has it; mend: dispose of models and cloths that are not used";
      throw new DClothError(abi.DCLOTH_ERROR_MEMORY, text);
    }
    ++this.blockCount;
    this.u8.fill(0, address, address + rounded);
    return address;
  }

  /** @param {number} address from lend */
  giveBack(address) {
    this.exports.free(address);
    --this.blockCount;
  }

  /**
   * Lends for the length of a call.
   * @template T
   * @param {number} size
   * @param {(address: number) => T} call
   */
  withBlock(size, call) {
    const address = this.lend(size);
    try {
      return call(address);
    } finally {
      this.giveBack(address);
    }
  }

  /** @param {number} address of terminated UTF-8 */
  text(address) {
    if (address === 0) return "";
    const u8 = this.u8;
    return UTF8.decode(u8.slice(address, u8.indexOf(0, address)));
  }

  /**
   * A table of pointers to terminated UTF-8, for the length of a call.
   * @template T
   * @param {readonly string[]} names
   * @param {(table: number) => T} call
   */
  withNames(names, call) {
    const texts = names.map((name) => TO_UTF8.encode(name));
    const size = texts.reduce((sum, text) => sum + text.length + 1, 4 * texts.length);
    return this.withBlock(size, (table) => {
      let at = table + 4 * texts.length;
      texts.forEach((text, i) => {
        this.u32[table / 4 + i] = at;
        this.u8.set(text, at);
        at += text.length + 1;
      });
      return call(table);
    });
  }

  /**
   * Makes a call that fills a dcloth_error and throws what it says.
   * @param {string} what heads the message
   * @param {(error: number) => number} call
   */
  check(what, call) {
    this.withBlock(abi.dcloth_error.bytes, (error) => {
      this.u32[(error + abi.dcloth_error.struct_size) / 4] = abi.dcloth_error.bytes;
      const status = call(error);
      if (status === abi.DCLOTH_OK) return;
      const offset = this.u64[(error + abi.dcloth_error.offset_bytes) / 8];
      const text = `${what}: ${this.text(error + abi.dcloth_error.text)}`;
      throw new DClothError(status, text, offset === 0xffffffffffffffffn ? null : Number(offset));
    });
  }
}
