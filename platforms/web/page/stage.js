import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";

const BACKDROP = 0xe9e5de;

/** Room, light and camera: a warm key light with soft shadows, a cool one from behind, a bright room around. */
export class Stage {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.renderer.toneMapping = THREE.NeutralToneMapping;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(BACKDROP);
    this.scene.fog = new THREE.Fog(BACKDROP, 14, 34);
    const room = new THREE.PMREMGenerator(this.renderer);
    this.scene.environment = room.fromScene(new RoomEnvironment(), 0.04).texture;
    this.scene.environmentIntensity = 0.38;
    room.dispose();

    this.key = new THREE.DirectionalLight(0xfff1df, 2.3);
    this.key.castShadow = true;
    this.key.shadow.mapSize.set(2048, 2048);
    this.key.shadow.bias = -0.0004;
    this.key.shadow.normalBias = 0.012;
    this.key.shadow.radius = 5;
    const rim = new THREE.DirectionalLight(0xcfe0ff, 1.1);
    rim.position.set(-4, 5, -7);
    const floor = new THREE.Mesh(
      new THREE.CircleGeometry(60, 48).rotateX(-Math.PI / 2),
      new THREE.MeshStandardMaterial({ color: 0xe4dfd7, roughness: 0.95, envMapIntensity: 0.5 }));
    floor.receiveShadow = true;
    this.scene.add(this.key, this.key.target, rim, floor);

    this.camera = new THREE.PerspectiveCamera(30, 1, 0.1, 80);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = true;
    this.controls.maxPolarAngle = 1.52;
    this.controls.minDistance = 1.2;
    this.controls.maxDistance = 22;
    this.#resize();
    new ResizeObserver(() => this.#resize()).observe(canvas);
  }

  /**
   * Camera and shadow around characters that stand within `width` x `depth` metres.
   * @param {number} width
   * @param {number} depth
   */
  frame(width, depth) {
    const { camera, controls, key } = this;
    const across = Math.tan((camera.fov * Math.PI) / 360) * camera.aspect;
    const tall = Math.tan((camera.fov * Math.PI) / 360);
    // Turned sideways the rows show their ends, and the front one is near.
    const distance = Math.max((0.96 * width + 0.4 * depth + 1.9) / 2 / across, (1.15 + 0.1 * depth) / tall)
        + 0.6 * depth;
    const direction = new THREE.Vector3(0.3, 0.2 + 0.035 * Math.min(depth, 6), 1).normalize();
    controls.target.set(0, 0.7, 0);
    camera.position.copy(controls.target).addScaledVector(direction, distance);
    const reach = Math.hypot(width, depth) / 2 + 1.6;
    key.position.set(3.2, 5.4, 4.2).setLength(reach + 6);
    key.shadow.camera.near = 0.5;
    key.shadow.camera.far = 2 * reach + 12;
    Object.assign(key.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach });
    key.shadow.camera.updateProjectionMatrix();
    this.scene.fog.near = distance + 6;
    this.scene.fog.far = distance + 26;
    controls.update();
  }

  draw() {
    this.controls.update();
    this.renderer.render(this.scene, this.camera);
  }

  #resize() {
    const { clientWidth, clientHeight } = this.renderer.domElement;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
  }
}
