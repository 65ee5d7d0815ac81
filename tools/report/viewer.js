// The moving garment: panes, playback, pointer and key control. Everything drawn follows from `state`.

const THEMES = {
  dark: {background: [0.075, 0.082, 0.095], pool: [0.20, 0.212, 0.235]},
  light: {background: [0.925, 0.918, 0.905], pool: [0.965, 0.96, 0.95]},
};
// Linear albedo.
const CLOTH_OUTER = [0.56, 0.062, 0.045];
const CLOTH_INNER = [0.60, 0.34, 0.18];
const TRUTH_OUTER = [0.052, 0.15, 0.30];
const TRUTH_INNER = [0.30, 0.38, 0.44];
const BODY_COLOR = [0.40, 0.375, 0.355];
const STICK_COLOR = [0.30, 0.29, 0.28];

class Viewer {
  constructor(canvas, state, garment, body, listener) {
    this.state = state;
    this.garment = garment;
    this.body = body;
    this.listener = listener;
    this.renderer = new Renderer(canvas);
    this.camera = new Camera(canvas, () => this.invalidate());
    for (const key of ['yaw', 'pitch', 'distance']) if (Number.isFinite(state[key])) this.camera[key] = state[key];
    this.edges = meshEdges(garment.faces);
    this.cloths = [0, 1].map(() => this.renderer.createMesh(garment.count, garment.faces));
    this.bodyMesh = body ? this.renderer.createMesh(body.count, body.faces, body.colours, body)
                         : this.renderer.createMesh(report.sticks.length * 6, stickMesh(report.sticks));
    this.truth = new Float32Array(garment.count * 3);
    this.folds = new Float32Array(garment.count);
    this.errors = new Float32Array(garment.count);
    this.joints = new Float32Array(report.joint_count * 12);
    this.lastTime = null;
    new ResizeObserver(() => this.invalidate()).observe(canvas);
  }

  setSequence(sequence) {
    this.sequence = sequence;
    this.path = smoothPath(sequence.hips, sequence.frames, sequence.fps, 0.45);
    this.findExtent();
    this.invalidate();
  }

  // Of the figure over the clip: its lowest point, where the level floor is, and how far it reaches below and above the
  // path that the camera follows.
  findExtent() {
    let lowest = Infinity, below = 0, above = 0;
    const stride = Math.max(1, Math.floor(this.sequence.frames / 20));
    for (let f = 0; f < this.sequence.frames; f += stride) {
      this.poseBody(f);
      const path = this.path[f * 3 + 1];
      for (let i = 1; i < this.bodyMesh.positions.length; i += 3) {
        const y = this.bodyMesh.positions[i];
        lowest = Math.min(lowest, y);
        below = Math.min(below, y - path);
        above = Math.max(above, y - path);
      }
    }
    this.groundY = Number.isFinite(lowest) ? lowest : 0;
    this.lift = (below + above) / 2;
    this.camera.frame(above - below);
  }

  poseBody(time) {
    frameJoints(this.sequence, time, this.joints);
    if (this.body) skinBody(this.body, this.joints, this.bodyMesh.positions);
    else stickPositions(report.sticks, this.joints, this.bodyMesh.positions);
  }

  invalidate() {
    if (this.pending) return;
    this.pending = true;
    requestAnimationFrame((now) => {
      this.pending = false;
      this.frame(now);
    });
  }

  frame(now) {
    if (!this.sequence) return;
    const {state, sequence} = this;
    if (state.playing) {
      const elapsed = this.lastTime === null ? 0 : Math.min(0.1, (now - this.lastTime) / 1000);
      state.frame = (state.frame + elapsed * sequence.fps * state.speed) % Math.max(1, sequence.frames - 1);
    }
    this.lastTime = state.playing ? now : null;
    state.frame = clamp(state.frame, 0, sequence.frames - 1);
    this.draw();
    this.listener(state.frame);
    if (state.playing) this.invalidate();
  }

  poseCloth(mesh, name, time, truthTrack) {
    const quantum = report.quantum_mm / 1000;
    framePositions(this.sequence, this.sequence.tracks.get(name), time, quantum, mesh.positions);
    smoothNormals(mesh.positions, this.garment.faces, mesh.normals);
    foldDepth(mesh.positions, mesh.normals, this.edges, this.folds);
    if (truthTrack) {
      framePositions(this.sequence, truthTrack, time, quantum, this.truth);
      errorMillimetres(mesh.positions, this.truth, this.errors);
    }
    for (let i = 0; i < this.folds.length; i++) {
      mesh.scalars[2 * i] = truthTrack ? this.errors[i] : 0;
      mesh.scalars[2 * i + 1] = this.folds[i];
    }
    this.renderer.upload(mesh);
  }

  draw() {
    const {state, sequence} = this;
    const time = state.frame;
    this.poseBody(time);
    smoothNormals(this.bodyMesh.positions, this.body ? this.body.smoothFaces : this.bodyMesh.faces,
                  this.bodyMesh.normals);
    if (this.body && this.body.same) spread(this.body.same, this.bodyMesh.normals);
    this.renderer.upload(this.bodyMesh);
    const truthTrack = sequence.tracks.get('truth');
    const names = state.split && truthTrack && state.variant !== 'truth' ? ['truth', state.variant] : [state.variant];
    const panes = names.map((name, i) => {
      this.poseCloth(this.cloths[i], name, time, truthTrack);
      const isTruth = name === 'truth';
      return {
        x: i / names.length, width: 1 / names.length,
        meshes: [
          {mesh: this.bodyMesh, material: 1,
              outer: !this.body ? STICK_COLOR : this.body.colours ? [1, 1, 1] : BODY_COLOR, inner: BODY_COLOR},
          {mesh: this.cloths[i], material: state.color === 'error' && truthTrack && !isTruth ? 2 : 0,
           outer: isTruth ? TRUTH_OUTER : CLOTH_OUTER, inner: isTruth ? TRUTH_INNER : CLOTH_INNER},
        ],
      };
    });
    const f0 = Math.min(Math.floor(time), sequence.frames - 1);
    const f1 = Math.min(f0 + 1, sequence.frames - 1);
    const hips = [0, 1, 2].map((c) => this.path[f0 * 3 + c] * (1 - time + f0) + this.path[f1 * 3 + c] * (time - f0));
    this.camera.focus = [hips[0], hips[1] + this.lift, hips[2]];
    this.renderer.draw(panes, this.camera, this.camera.focus, this.groundY, THEMES[state.theme], state.errorScale);
  }
}
