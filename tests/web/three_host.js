// A page's code without the page: a rig as Mixamo's files come, in centimetres, Z up, below a node that turns and
// scales it, wears the skirt and walks. Its skin is bound in that space or in the scene's, as exporters differ.
// three_test.js starts it. Arguments: SITE PAGE SPACE; prints one line of JSON.
import { readFileSync } from "node:fs";
import * as THREE from "three";
import { loadEngine } from "dcloth";
import { ClothMesh } from "dcloth/three";

const [site, page, space] = process.argv.slice(2);
const { readSafetensors } = await import(`${page}/safetensors.js`);
const { Figure } = await import("./figure.js");
const bytes = (path) => new Uint8Array(readFileSync(path)).buffer;      // exactly the file's
const engine = await loadEngine({ kernels: "simd", simd: bytes(`${site}/dcloth/dcloth.wasm`) });
const model = engine.openModel(bytes(`${site}/garment/skirt.dcloth`), "skirt");
const figure = new Figure(readSafetensors(bytes(`${site}/garment/character.safetensors`), "character"));
const { tensors, metadata } = readSafetensors(bytes(`${site}/garment/walk_turn.safetensors`), "walk_turn");
const names = JSON.parse(metadata.joint_names), poses = tensors.joint_matrices.data;

const armature = new THREE.Object3D();
armature.rotation.x = -Math.PI / 2;
armature.scale.setScalar(0.01);
armature.updateMatrixWorld();
const into = armature.matrixWorld.clone().invert();      // the scene -> centimetres, Z up
const bones = names.map((name) =>
  Object.assign(new THREE.Bone(), { name: `mixamorig:${name}`, matrixAutoUpdate: false }));
const bound = space === "scene" ? new THREE.Matrix4() : into;
const inverses = names.map((name) => {
  const bind = figure.inverses[figure.jointNames.indexOf(name)].clone().invert();
  return bind.premultiply(bound).invert();
});
const geometry = figure.geometry.clone().applyMatrix4(bound);
const order = figure.jointNames.map((name) => names.indexOf(name));
const index = geometry.getAttribute("skinIndex");
for (let i = 0; i < index.array.length; ++i) index.array[i] = order[index.array[i]];
const hero = new THREE.SkinnedMesh(geometry);
armature.add(hero, ...bones);
hero.bind(new THREE.Skeleton(bones, inverses), new THREE.Matrix4());

/** @param {number} frame */
function pose(frame) {
  bones.forEach((bone, j) => {
    bone.matrix.fromArray(poses, 16 * (frame * names.length + j)).transpose().premultiply(into);
    bone.matrixWorldNeedsUpdate = true;
  });
  armature.updateMatrixWorld();
}
pose(40);                                                // bound in a T-pose, seen in a step
const skirt = new ClothMesh(model, hero);
const plain = model.createCloth({ jointNames: names });
skirt.cloth.outsideBody = false;
let sum = 0, count = 0;
for (let frame = 0; frame < 60; ++frame) {
  pose(frame);
  // The plain cloth knows bones without the file's scale and turn: those of the sequence itself.
  for (let j = 0; j < names.length; ++j)
    new THREE.Matrix4().fromArray(poses, 16 * (frame * names.length + j)).transpose().toArray(plain.pose, 16 * j);
  skirt.update(1 / 30);
  plain.update(1 / 30);
  if (frame < 12) continue;
  for (let i = 0; i < plain.positions.length; i += 3) {
    sum += Math.hypot(...[0, 1, 2].map((c) => plain.positions[i + c] - skirt.cloth.positions[i + c]));
    ++count;
  }
}
const attribute = skirt.geometry.getAttribute("position");
const { center, radius } = skirt.geometry.boundingSphere;
const { fit } = skirt.cloth;
const shared = attribute.array === skirt.cloth.positions;
skirt.dispose();
plain.dispose();
model.dispose();
console.log(JSON.stringify({ mm: 1000 * sum / count, scale: fit.scale, warnings: fit.warnings, shared, radius,
  height: center.y, blocks: engine.memory.blockCount, vertices: attribute.count,
  uv: skirt.geometry.attributes.uv.count, of_seams: attribute.count - model.vertexCount }));
