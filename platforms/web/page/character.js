import * as THREE from "three";
import { Disc } from "./disc.js";
import { poseSkin } from "./figure.js";

const HEIGHT = 0.03; // of the disc
const FADE_SECONDS = 0.3;

/** A figure and its garment on one motion, which it plays again and again: cut, and the cloth is reset. */
export class Character {
  /**
   * @param {import("dcloth").Model} model
   * @param {import("./figure.js").Figure} figure
   * @param {{ motion: import("./motion.js").Motion, truth: import("./truth.js").Truth }} clip
   * @param {{ color: number, startSeconds: number }} look
   */
  constructor(model, figure, clip, look) {
    this.clip = clip;
    this.seconds = look.startSeconds;
    this.cloth = model.createCloth({ jointNames: clip.motion.jointNames });
    this.group = new THREE.Group();
    this.disc = new Disc();
    this.moving = new THREE.Group();
    this.moving.position.y = HEIGHT;
    const painted = figure.geometry.hasAttribute("color");
    this.skin = figure.createSkin(new THREE.MeshPhysicalMaterial({
      color: painted ? 0xffffff : 0xd9cfc3, vertexColors: painted, roughness: 0.62, clearcoat: 0.15,
      clearcoatRoughness: 0.6 }));
    this.geometry = new THREE.BufferGeometry()
      .setAttribute("position", new THREE.BufferAttribute(this.cloth.positions, 3).setUsage(THREE.DynamicDrawUsage))
      .setAttribute("normal", new THREE.BufferAttribute(this.cloth.normals, 3).setUsage(THREE.DynamicDrawUsage))
      .setIndex(new THREE.BufferAttribute(model.triangles, 1));
    this.geometry.boundingSphere = new THREE.Sphere();
    this.garment = new THREE.Mesh(this.geometry, new THREE.MeshPhysicalMaterial({
      color: look.color, roughness: 0.78, sheen: 0.7, sheenRoughness: 0.45,
      sheenColor: new THREE.Color(look.color).lerp(new THREE.Color(0xffffff), 0.45), side: THREE.DoubleSide,
      shadowSide: THREE.DoubleSide }));
    this.garment.castShadow = this.garment.receiveShadow = true;
    this.moving.add(this.skin, this.garment);
    this.group.add(this.disc, this.moving);
    /** Of the last frames, or NaN. */
    this.errorMm = NaN;
  }

  /**
   * Moves on by `seconds` and poses; then the cloth is to be updated.
   * @param {number} seconds
   */
  advance(seconds) {
    const { motion } = this.clip;
    this.seconds += seconds;
    if (this.seconds > motion.seconds + 1e-6) this.restart(this.seconds % motion.seconds);
    motion.at(this.seconds, this.cloth.pose);
  }

  /** A cut to a time of the motion. @param {number} seconds */
  restart(seconds) {
    this.seconds = seconds;
    this.errorMm = NaN;
    this.cloth.reset();
  }

  /** Brings the last update to the screen: the engine's memory goes to the GPU as it is. */
  show() {
    const { cloth, geometry } = this;
    for (const [name, array] of [["position", cloth.positions], ["normal", cloth.normals]]) {
      const attribute = geometry.getAttribute(name);
      attribute.array = array;
      attribute.needsUpdate = true;
    }
    const [x0, y0, z0, x1, y1, z1] = cloth.bounds;
    geometry.boundingSphere.center.set((x0 + x1) / 2, (y0 + y1) / 2, (z0 + z1) / 2);
    geometry.boundingSphere.radius = Math.hypot(x1 - x0, y1 - y0, z1 - z0) / 2;
    poseSkin(this.skin, cloth.pose);
    const x = cloth.pose[12], z = cloth.pose[14]; // the hips stay over the disc
    this.moving.position.set(-x, HEIGHT, -z);
    this.disc.moveTo(x, z);
    const left = this.clip.motion.seconds - this.seconds;
    this.#fade(Math.min(1, Math.max(0, Math.min(left, this.seconds + 0.02) / FADE_SECONDS)));
  }

  /** Mean distance to the truth now, smoothed over some frames. */
  measure() {
    const now = this.clip.truth.distanceMm(this.cloth.positions, this.seconds);
    this.errorMm = Number.isNaN(this.errorMm) ? now : this.errorMm + 0.1 * (now - this.errorMm);
    return this.errorMm;
  }

  dispose() {
    this.group.removeFromParent();
    this.geometry.dispose();
    this.garment.material.dispose();
    this.skin.material.dispose();
    this.skin.skeleton.dispose();
    this.disc.dispose();
    this.cloth.dispose();
  }

  /** @param {number} opacity */
  #fade(opacity) {
    for (const mesh of [this.skin, this.garment]) {
      mesh.visible = opacity > 0.02;
      mesh.castShadow = opacity > 0.5;
      mesh.material.opacity = opacity;
      if (mesh.material.transparent !== opacity < 1) {
        mesh.material.transparent = opacity < 1;
        mesh.material.needsUpdate = true;
      }
    }
  }
}
