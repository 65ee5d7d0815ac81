import type { Material, Mesh, SkinnedMesh } from "three";
import type { Character } from "./fit.js";
import type { Cloth, Model } from "./index.js";

/** The character of a skinned mesh as it was bound, whatever pose its bones are in. */
export function characterOf(body: SkinnedMesh): Character;

/** A garment on the skeleton of a skinned mesh, fitted to it. Add it to the scene itself, not to the character. */
export class ClothMesh extends Mesh {
  constructor(model: Model, body: SkinnedMesh, material?: Material);
  /** The engine's cloth: wind, stages, jumps, save games; `cloth.fit` says how it fits. */
  readonly cloth: Cloth;
  /** One frame, after `scene.updateMatrixWorld()`. */
  update(seconds: number): void;
  dispose(): void;
}
