import * as THREE from "three";

export const DISC_RADIUS = 0.62;
const METRES = 0.5; // of the pattern's period

/** Fine dots that pass below a character who walks on the spot. */
function dots() {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 256;
  const context = canvas.getContext("2d");
  context.fillStyle = "#f4f1ec";
  context.fillRect(0, 0, 256, 256);
  context.fillStyle = "#c9c2b7";
  for (let x = 32; x < 256; x += 64) {
    for (let y = 32; y < 256; y += 64) {
      context.beginPath();
      context.arc(x, y, 5, 0, 2 * Math.PI);
      context.fill();
    }
  }
  const texture = new THREE.CanvasTexture(canvas);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.colorSpace = THREE.SRGBColorSpace;
  texture.anisotropy = 8;
  return texture;
}

let shared = null;

/** The plinth of a character: its top moves with the motion, its rim tells the level that runs. */
export class Disc extends THREE.Group {
  constructor() {
    super();
    shared ??= {
      top: new THREE.CircleGeometry(DISC_RADIUS, 64).rotateX(-Math.PI / 2),
      side: new THREE.CylinderGeometry(DISC_RADIUS, DISC_RADIUS + 0.012, 0.03, 64, 1, true),
      rim: new THREE.RingGeometry(DISC_RADIUS + 0.02, DISC_RADIUS + 0.055, 96).rotateX(-Math.PI / 2),
      dots: dots(),
    };
    this.texture = shared.dots.clone();
    this.texture.repeat.set((2 * DISC_RADIUS) / METRES, (2 * DISC_RADIUS) / METRES);
    const top = new THREE.Mesh(shared.top, new THREE.MeshStandardMaterial({ map: this.texture, roughness: 0.9 }));
    const side = new THREE.Mesh(shared.side, new THREE.MeshStandardMaterial({ color: 0xefebe5, roughness: 0.8 }));
    this.rim = new THREE.Mesh(shared.rim, new THREE.MeshBasicMaterial());
    top.position.y = 0.03;
    side.position.y = 0.015;
    this.rim.position.y = 0.004;
    top.receiveShadow = side.castShadow = side.receiveShadow = true;
    this.add(top, side, this.rim);
  }

  /** @type {(x: number, z: number) => void} */
  moveTo(x, z) {
    this.texture.offset.set((x / METRES) % 1, (-z / METRES) % 1);
  }

  dispose() {
    this.texture.dispose();
    for (const mesh of this.children) mesh.material.dispose();
  }
}
