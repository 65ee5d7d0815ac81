import * as abi from "./abi.js";
import { Cloth } from "./cloth.js";
import { throwUnlessOk } from "./error.js";

/** @typedef {import("./engine.js").Engine} Engine */

/** A garment that was trained. Any number of cloths share one, and keep its memory until the last is disposed of. */
export class Model {
  #users = 1;
  #disposed = false;
  #bytes;
  #storage = 0;

  name = "";
  /** "fp32", "fp16", "int8" */
  precision = "";
  /** Of the model file, "1.2" for instance. */
  format = "";
  jointCount = 0;
  /** [jointCount, 16] joint to world in the bind pose of training: columns contiguous, metres, the default axes. */
  bindMatrices = new Float32Array(0);
  vertexCount = 0;
  triangleCount = 0;
  /** The DCLOTH_STAGES_* it holds. */
  stages = 0;
  tickSeconds = 0;
  /** [triangleCount, 3], a copy */
  triangles = new Uint16Array();
  /** The coarse mesh, for Draw.COARSE: its vertices of the garment, rising; empty before format 1.6. A copy. */
  coarseVertices = new Uint16Array();
  /** [t, 3], indices into coarseVertices, a copy. */
  coarseTriangles = new Uint16Array();
  /** [texturedVertexCount, 2] u right, v down as in glTF: of the garment's vertices, then of those repeated at seams.
   * Empty where the model holds none. A copy. */
  textureCoordinates = new Float32Array();
  /** [triangleCount, 3] by textured vertices, a copy. */
  texturedTriangles = new Uint16Array();
  texturedVertexCount = 0;

  /**
   * Use Engine.openModel.
   * @param {Engine} engine
   * @param {ArrayBuffer | ArrayBufferView} bytes
   * @param {string} name
   */
  constructor(engine, bytes, name) {
    const { memory, exports } = engine;
    const source = ArrayBuffer.isView(bytes) ? new Uint8Array(bytes.buffer, bytes.byteOffset, bytes.byteLength)
      : new Uint8Array(bytes);
    this.engine = engine;
    this.address = 0;
    this.#bytes = memory.lend(source.length);
    try {
      memory.u8.set(source, this.#bytes);
      const storageSize = exports.dcloth_model_storage_size();
      this.#storage = memory.lend(storageSize);
      memory.withBlock(4, (result) => {
        memory.check(name, (error) =>
          exports.dcloth_model_open(this.#bytes, source.length, this.#storage, storageSize, result, error));
        this.address = memory.u32[result / 4];
      });
      this.#describe();
      this.bindMatrices = this.#bindMatrices();
    } catch (error) {
      this.#giveBack();
      throw error;
    }
    /** In the order of a pose's matrices. */
    this.jointNames = Array.from({ length: this.jointCount }, (_, i) =>
      memory.text(exports.dcloth_model_joint_name(this.address, i)));
    const parents = this.jointNames.map((_, i) => exports.dcloth_model_joint_parent(this.address, i));
    /** Index of the nearest joint above each one, -1 at the top; null where the file does not tell. */
    this.jointParents = parents.includes(abi.DCLOTH_JOINT_UNKNOWN) ? null : parents;
    /** Whether `outsideBody` does anything. */
    this.hasBody = exports.dcloth_model_body_vertex_count(this.address) > 0;
    /** Whether Cloth.setWind changes the garment's motion. */
    this.readsWind = exports.dcloth_model_reads_wind(this.address) !== 0;
    /** Bytes that each cloth takes. */
    this.clothBytes = exports.dcloth_cloth_storage_size(this.address);
  }

  /**
   * A garment on a character. Errors: DClothError; JOINTS lists the names that are missing.
   * @param {import("./cloth.js").ClothOptions} [options]
   */
  createCloth(options) {
    return new Cloth(this, options);
  }

  /** Its memory goes when the last of its cloths is disposed of too. */
  dispose() {
    if (this.#disposed) return;
    this.#disposed = true;
    this.release();
  }

  /** For cloths. */
  retain() {
    if (this.#disposed) throw new Error(`dcloth: model ${this.name} was disposed of`);
    ++this.#users;
  }

  /** For cloths. */
  release() {
    if (--this.#users === 0) this.#giveBack();
  }

  #describe() {
    const { memory, exports } = this.engine;
    const info = abi.dcloth_model_info;
    memory.withBlock(info.bytes, (at) => {
      /** @param {number} offset */
      const word = (offset) => memory.u32[(at + offset) / 4];
      memory.u32[at / 4] = info.bytes;
      throwUnlessOk(exports.dcloth_model_describe(this.address, at), "dcloth_model_describe");
      this.name = memory.text(word(info.name));
      this.precision = memory.text(word(info.precision));
      this.format = `${word(info.format_major)}.${word(info.format_minor)}`;
      this.jointCount = word(info.joint_count);
      this.vertexCount = word(info.vertex_count);
      this.triangleCount = word(info.triangle_count);
      this.stages = word(info.stages);
      this.tickSeconds = memory.f32[(at + info.tick_seconds) / 4];
      /** @param {number} start @param {number} count */
      const halfWords = (start, count) => new Uint16Array(memory.buffer.slice(start, start + 2 * count));
      this.triangles = halfWords(word(info.triangles), 3 * this.triangleCount);
      this.coarseVertices = halfWords(word(info.coarse_vertices), word(info.coarse_vertex_count));
      this.coarseTriangles = halfWords(word(info.coarse_triangles), 3 * word(info.coarse_triangle_count));
      this.texturedVertexCount = word(info.textured_vertex_count);
      if (this.texturedVertexCount === 0) return;
      const places = word(info.texture_coordinates);
      this.textureCoordinates = new Float32Array(memory.buffer.slice(places, places + 8 * this.texturedVertexCount));
      this.texturedTriangles = halfWords(word(info.textured_triangles), 3 * this.triangleCount);
    });
  }

  #bindMatrices() {
    const { memory, exports } = this.engine;
    return memory.withBlock(64, (at) => {
      const matrices = new Float32Array(16 * this.jointCount);
      for (let joint = 0; joint < this.jointCount; ++joint) {
        throwUnlessOk(exports.dcloth_model_joint_bind(this.address, joint, at), "dcloth_model_joint_bind");
        for (let i = 0; i < 16; ++i) matrices[16 * joint + 4 * (i % 4) + (i >> 2)] = memory.f32[at / 4 + i];
      }
      return matrices;
    });
  }

  #giveBack() {
    if (this.#storage !== 0) this.engine.memory.giveBack(this.#storage);
    this.engine.memory.giveBack(this.#bytes);
    this.#storage = 0;
    this.address = 0;
  }
}
