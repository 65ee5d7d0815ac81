// Orbit camera about a point that follows the hips. One finger or left drag orbits, two fingers or right drag pan,
// wheel or pinch zooms, double click returns to the start.

const HALF_VIEW = Math.tan(0.31);  // of the height at a distance of 1
const START_VIEW = {yaw: 0.55, pitch: 0.09, distance: 3.15, pan: [0, 0]};

class Camera {
  constructor(canvas, changed) {
    Object.assign(this, structuredClone(START_VIEW));
    this.focus = [0, 0.9, 0];
    this.home = START_VIEW.distance;
    this.changed = changed;
    this.pointers = new Map();
    canvas.addEventListener('pointerdown', (e) => this.down(canvas, e));
    canvas.addEventListener('pointermove', (e) => this.move(canvas, e));
    for (const name of ['pointerup', 'pointercancel']) {
      canvas.addEventListener(name, (e) => this.pointers.delete(e.pointerId));
    }
    canvas.addEventListener('wheel', (e) => {
      e.preventDefault();
      this.zoom(Math.exp(e.deltaY * 0.001));
    }, {passive: false});
    canvas.addEventListener('contextmenu', (e) => e.preventDefault());
    canvas.addEventListener('dblclick', () => {
      Object.assign(this, structuredClone(START_VIEW), {distance: this.home});
      this.changed();
    });
  }

  // The start view: so far away that `height` metres about the focus are seen, with a margin, and what stands nearer.
  frame(height) {
    const moved = this.distance !== this.home;
    this.home = clamp(1.08 * height / 2 / HALF_VIEW + 0.3, 0.5, 9);
    if (!moved) this.distance = this.home;
  }

  down(canvas, event) {
    canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    this.panning = event.button === 2 || event.shiftKey;
  }

  move(canvas, event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const dx = event.clientX - before[0];
    const dy = event.clientY - before[1];
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const span = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]);
      this.zoom(span(before) / Math.max(1, span([event.clientX, event.clientY])));
      this.shift(dx / 2, dy / 2, canvas);
    } else if (this.panning) {
      this.shift(dx, dy, canvas);
    } else {
      this.yaw -= dx * 0.008;
      this.pitch = clamp(this.pitch + dy * 0.006, -0.35, 1.45);
    }
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
    this.changed();
  }

  shift(dx, dy, canvas) {
    const metres = this.distance * 0.62 / canvas.clientHeight;
    this.pan[0] = clamp(this.pan[0] - dx * metres, -3, 3);
    this.pan[1] = clamp(this.pan[1] + dy * metres, -1.2, 1.5);
  }

  zoom(factor) {
    this.distance = clamp(this.distance * factor, 0.5, 9);
    this.changed();
  }

  matrices(aspect) {
    const cosine = Math.cos(this.pitch);
    const out = [Math.sin(this.yaw) * cosine, Math.sin(this.pitch), Math.cos(this.yaw) * cosine];
    const right = [Math.cos(this.yaw), 0, -Math.sin(this.yaw)];
    let target = add(this.focus, right, this.pan[0]);
    target = add(target, [0, 1, 0], this.pan[1]);
    // A narrow pane keeps the width of a square one, so that side by side does not crop the character.
    const fov = 2 * Math.atan(HALF_VIEW * Math.max(1, 0.72 / aspect));
    const eye = add(target, out, this.distance);
    eye[1] = Math.max(eye[1], 0.03);
    return {eye, matrix: multiply(perspective(fov, aspect, 0.05, 40), lookAt(eye, target, [0, 1, 0]))};
  }
}

// The hips' path under a Gaussian of `sigma` seconds: depends on the frame alone, so every picture is reproducible.
function smoothPath(points, frames, fps, sigma) {
  const reach = Math.ceil(3 * sigma * fps);
  const out = new Float32Array(frames * 3);
  for (let f = 0; f < frames; f++) {
    let total = 0;
    for (let k = -reach; k <= reach; k++) {
      const at = clamp(f + k, 0, frames - 1);
      const w = Math.exp(-0.5 * (k / (sigma * fps)) ** 2);
      total += w;
      for (let c = 0; c < 3; c++) out[f * 3 + c] += w * points[at * 3 + c];
    }
    for (let c = 0; c < 3; c++) out[f * 3 + c] /= total;
  }
  return out;
}
