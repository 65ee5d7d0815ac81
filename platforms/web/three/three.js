import * as THREE from "three";

/**
 * From the space that a skeleton was bound in to the scene. Exporters choose that space: the one below the skeleton's
 * parents, or the scene's. The size of a bone today over its size when bound tells which, in any pose.
 * @param {THREE.Skeleton} skeleton
 */
function boundToScene({ bones, boneInverses }) {
  const moved = bones.map((bone, j) => new THREE.Matrix4().multiplyMatrices(bone.matrixWorld, boneInverses[j]));
  const size = Math.cbrt(Math.abs(moved[0].determinant()));
  const top = bones.find((bone) => !bones.includes(bone.parent));
  const above = top.parent ? top.parent.matrixWorld.clone() : new THREE.Matrix4();
  const isSame = (a, b) => a.elements.every((x, i) => Math.abs(x - b.elements[i]) <= 1e-3 * Math.max(size, 1e-6));
  if (moved.every((matrix) => isSame(matrix, moved[0]))) return moved[0];     // it stands as it was bound
  const turnOf = (matrix) => new THREE.Quaternion().setFromRotationMatrix(new THREE.Matrix4().extractRotation(matrix));
  const hips = turnOf(moved[bones.indexOf(top)]);
  const turns = [turnOf(above), new THREE.Quaternion()];
  const [turn] = turns.sort((a, b) => a.angleTo(hips) - b.angleTo(hips));
  return new THREE.Matrix4().compose(new THREE.Vector3().setFromMatrixPosition(above), turn,
    new THREE.Vector3().setScalar(size));
}

/**
 * The character of a skinned mesh as it was bound, whatever pose its bones are in: for `Model.createCloth`. The
 * matrices of the scene must be up to date (`updateMatrixWorld`).
 * @param {THREE.SkinnedMesh} body
 */
export function characterOf(body) {
  const { bones, boneInverses } = body.skeleton;
  const toScene = boundToScene(body.skeleton), bind = new THREE.Matrix4(), point = new THREE.Vector3();
  const bindMatrices = bones.flatMap((_, j) => bind.copy(boneInverses[j]).invert().premultiply(toScene).toArray());
  const skinToScene = new THREE.Matrix4().multiplyMatrices(toScene, body.bindMatrix);
  const { position, skinIndex, skinWeight } = body.geometry.attributes;
  const positions = new Float32Array(3 * position.count), joints = new Uint32Array(4 * position.count);
  const weights = new Float32Array(4 * position.count);
  for (let v = 0; v < position.count; ++v) {
    point.fromBufferAttribute(position, v).applyMatrix4(skinToScene).toArray(positions, 3 * v);
    for (let k = 0; k < 4; ++k) {
      joints[4 * v + k] = skinIndex.getComponent(v, k);
      weights[4 * v + k] = skinWeight.getComponent(v, k);
    }
  }
  const triangles = body.geometry.index?.array;
  return { jointNames: bones.map((bone) => bone.name), bindMatrices, body: { positions, joints, weights, triangles } };
}

/**
 * A garment on the skeleton of a skinned mesh, fitted to it, with the model's texture coordinates where it holds some
 * (as glTF's: `texture.flipY = false`). Vertices are in the scene's space: add it to the scene
 * itself, not to the character. It shares the engine's memory with the GPU's buffers.
 * Errors: DClothError where the rig would crumple the garment. Cost: `update` makes no garbage.
 */
export class ClothMesh extends THREE.Mesh {
  #bones;
  #box = new THREE.Box3();

  /**
   * @param {import("dcloth").Model} model
   * @param {THREE.SkinnedMesh} body as loaded, before or after it moves
   * @param {THREE.Material} [material] draws both sides: skirts are seen from inside
   */
  constructor(model, body, material = new THREE.MeshStandardMaterial({ side: THREE.DoubleSide })) {
    const textured = model.texturedVertexCount > 0;
    const cloth = model.createCloth({ character: characterOf(body), textured });
    const attribute = (array) => new THREE.BufferAttribute(array, 3).setUsage(THREE.DynamicDrawUsage);
    const triangles = textured ? model.texturedTriangles : model.triangles;
    const geometry = new THREE.BufferGeometry().setIndex(new THREE.BufferAttribute(triangles, 1))
      .setAttribute("position", attribute(cloth.positions)).setAttribute("normal", attribute(cloth.normals));
    if (textured) geometry.setAttribute("uv", new THREE.BufferAttribute(model.textureCoordinates, 2));
    geometry.boundingSphere = new THREE.Sphere();   // else three.js keeps that of the first frame
    super(geometry, material);
    /** The engine's cloth: wind, stages, jumps, save games; `cloth.fit` says how it fits. */
    this.cloth = cloth;
    this.#bones = body.skeleton.bones;
    this.cloth.outsideBody = model.hasBody;
  }

  /**
   * One frame; call it after `scene.updateMatrixWorld()`, else the bones are a frame late.
   * @param {number} seconds since the last one
   */
  update(seconds) {
    const { cloth, geometry } = this, { pose } = cloth, bones = this.#bones;
    for (let j = 0; j < bones.length; ++j) bones[j].matrixWorld.toArray(pose, 16 * j);
    cloth.update(seconds);
    const { position, normal } = geometry.attributes;
    position.array = cloth.positions;   // another view after the engine's memory has grown
    normal.array = cloth.normals;
    position.needsUpdate = normal.needsUpdate = true;
    this.#box.setFromArray(cloth.bounds).getBoundingSphere(geometry.boundingSphere);
  }

  /** Gives the engine's memory and the GPU's back; the material is its owner's. */
  dispose() {
    this.removeFromParent();
    this.geometry.dispose();
    this.cloth.dispose();
  }
}
