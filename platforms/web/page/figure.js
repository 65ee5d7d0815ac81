import * as THREE from "three";

const INFLUENCES = 4;

/** The character's skin of a training bundle (converter/BUNDLE.md), one geometry for all characters. */
export class Figure {
  /** @param {{ tensors: any, metadata: any }} character body.* and character.bind of a bundle */
  constructor({ tensors, metadata }) {
    this.jointNames = JSON.parse(metadata.joint_names);
    const weights = tensors["body.joint_weights"], joints = weights.shape[1], count = weights.shape[0];
    const index = new Uint16Array(count * INFLUENCES), weight = new Float32Array(count * INFLUENCES);
    for (let v = 0; v < count; ++v) {
      const row = Array.from(weights.data.subarray(v * joints, (v + 1) * joints), (w, j) => [w, j])
        .sort((a, b) => b[0] - a[0]).slice(0, INFLUENCES);
      const sum = row.reduce((total, [w]) => total + w, 0);
      row.forEach(([w, j], i) => {
        index[v * INFLUENCES + i] = j;
        weight[v * INFLUENCES + i] = w / sum;
      });
    }
    this.geometry = new THREE.BufferGeometry()
      .setAttribute("position", new THREE.BufferAttribute(tensors["body.positions"].data, 3))
      .setAttribute("skinIndex", new THREE.BufferAttribute(index, INFLUENCES))
      .setAttribute("skinWeight", new THREE.BufferAttribute(weight, INFLUENCES))
      .setIndex(new THREE.BufferAttribute(new Uint32Array(tensors["body.faces"].data), 1));
    this.geometry.computeVertexNormals();
    if (tensors["body.colours"]) this.geometry = painted(this.geometry, tensors["body.colours"].data);
    this.inverses = this.jointNames.map((_, j) =>
      new THREE.Matrix4().fromArray(tensors["character.bind"].data, 16 * j).transpose().invert());
  }

  /**
   * A skin whose bones are set by `pose`, the [jointCount, 16] matrices that the cloth gets.
   * @param {THREE.Material} material
   */
  createSkin(material) {
    const mesh = new THREE.SkinnedMesh(this.geometry, material);
    const bones = this.jointNames.map(() => new THREE.Bone());
    for (const bone of bones) bone.matrixAutoUpdate = false;
    mesh.add(...bones);
    mesh.bind(new THREE.Skeleton(bones, this.inverses), new THREE.Matrix4());
    mesh.frustumCulled = false;
    mesh.castShadow = mesh.receiveShadow = true;
    return mesh;
  }
}

/**
 * The geometry with each face in the colour of its last corner: a corner that others see in another colour is doubled.
 * @param {THREE.BufferGeometry} geometry
 * @param {Float32Array} colours [b, 3] sRGB
 */
function painted(geometry, colours) {
  const faces = geometry.index.array, index = new Uint32Array(faces.length);
  /** @type {number[]} */ const corners = [];
  /** @type {number[]} */ const paint = [];
  const known = new Map();
  for (let i = 0; i < faces.length; ++i) {
    const last = 3 * faces[i - (i % 3) + 2], colour = colours.slice(last, last + 3), key = `${faces[i]} ${colour}`;
    if (!known.has(key)) {
      known.set(key, corners.length);
      corners.push(faces[i]);
      colour.forEach((c) => paint.push(c ** 2.2));
    }
    index[i] = known.get(key);
  }
  const out = new THREE.BufferGeometry().setIndex(new THREE.BufferAttribute(index, 1));
  for (const [name, { array, itemSize }] of Object.entries(geometry.attributes)) {
    const values = new array.constructor(corners.length * itemSize);
    corners.forEach((v, i) => values.set(array.subarray(v * itemSize, (v + 1) * itemSize), i * itemSize));
    out.setAttribute(name, new THREE.BufferAttribute(values, itemSize));
  }
  return out.setAttribute("color", new THREE.BufferAttribute(new Float32Array(paint), 3));
}

/**
 * @param {THREE.SkinnedMesh} skin
 * @param {Float32Array} pose
 */
export function poseSkin(skin, pose) {
  skin.skeleton.bones.forEach((bone, j) => {
    bone.matrix.fromArray(pose, 16 * j);
    bone.matrixWorldNeedsUpdate = true;
  });
}
