// The worker's side of worker.js: an engine that is driven by messages.
import { loadEngine } from "./engine.js";
import { DClothError } from "./error.js";

/** @typedef {import("./cloth.js").Cloth} Cloth */
/** @typedef {import("./model.js").Model} Model */

/** What a message may ask of a cloth. */
const METHODS = ["reset", "setWind", "takeBindPose", "save", "restore"];

/**
 * Answers each message { id, call, args } by { id, result } or { id, error }.
 * @param {(message: any, transfer: ArrayBuffer[]) => void} send
 * @returns {(message: any) => Promise<void>}
 */
export function createServer(send) {
  /** @type {Promise<import("./engine.js").Engine> | null} */
  let loading = null;
  let next = 1;
  /** @type {Map<number, Model>} */
  const models = new Map();
  /** @type {Map<number, Cloth>} */
  const cloths = new Map();

  /** @type {(model: Model) => any} */
  const describe = (model) => {
    const id = next++;
    models.set(id, model);
    const { name, precision, format, jointNames, jointParents, bindMatrices, jointCount, vertexCount, triangleCount,
      triangles, textureCoordinates, texturedTriangles, texturedVertexCount, stages, tickSeconds, hasBody, readsWind,
      clothBytes } = model;
    return { id, name, precision, format, jointNames, jointParents, bindMatrices, jointCount, vertexCount,
      triangleCount, triangles, textureCoordinates, texturedTriangles, texturedVertexCount, stages, tickSeconds,
      hasBody, readsWind, clothBytes };
  };

  /** @type {(id: number) => Cloth} */
  const clothOf = (id) => {
    const cloth = cloths.get(id);
    if (cloth === undefined) throw new Error("dcloth: this cloth was disposed of");
    return cloth;
  };

  /** @type {Record<string, (args: any) => any>} */
  const calls = {
    async load(options) {
      loading = loadEngine(options);
      const { version, instructionSet, fallback } = await loading;
      return { version, instructionSet, fallback };
    },
    async openModel({ bytes, name }) {
      return describe((await engine()).openModel(bytes, name));
    },
    async fetchModel({ url }) {
      return describe(await (await engine()).fetchModel(url));
    },
    createCloth({ model, options }) {
      const opened = models.get(model);
      if (opened === undefined) throw new Error("dcloth: this model was disposed of");
      const cloth = opened.createCloth(options), id = next++;
      cloths.set(id, cloth);
      const views = [cloth.pose, cloth.positions, cloth.normals, cloth.tangents, cloth.bounds];
      const counts = views.map((view) => view.length);
      return { id, fit: cloth.fit, counts };
    },
    update({ cloth: id, memory, seconds, stages, flags, outsideBody, visible, jumped }) {
      const cloth = clothOf(id);
      cloth.pose.set(new Float32Array(memory, 0, cloth.pose.length));
      cloth.outsideBody = outsideBody;
      cloth.visible = visible;
      if (jumped) cloth.jump();
      cloth.update(seconds, stages, flags);
      if (visible) {
        let at = 4 * cloth.pose.length;
        for (const view of [cloth.positions, cloth.normals, cloth.tangents, cloth.bounds]) {
          new Float32Array(memory, at, view.length).set(view);
          at += 4 * view.length;
        }
      }
      return memory;
    },
    cloth({ cloth: id, method, values, pose }) {
      const cloth = clothOf(id);
      if (!METHODS.includes(method)) throw new Error(`dcloth: no call '${method}'; allowed: ${METHODS.join(", ")}`);
      if (pose !== undefined) cloth.pose.set(pose);
      return /** @type {any} */ (cloth)[method](...values);
    },
    dispose({ target }) {
      (cloths.get(target) ?? models.get(target))?.dispose();
      cloths.delete(target);
      models.delete(target);
    },
  };

  const engine = () => loading ?? Promise.reject(new Error("dcloth: no engine is loaded; send 'load' first"));

  return async ({ id, call, args }) => {
    try {
      const result = calls[call](args), ready = result instanceof Promise ? await result : result;
      send({ id, result: ready }, call === "update" ? [ready] : []);
    } catch (thrown) {
      const { message, status, offsetBytes } = /** @type {DClothError} */ (thrown);
      send({ id, error: { message, status, offsetBytes } }, []);
    }
  };
}
