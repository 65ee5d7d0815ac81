// Characters in learned skirts within a budget. Query: ?kernels=scalar takes the module without SIMD, ?still waits for
// step() instead of the clock. What the console and the tests may use is in globalThis.dclothPage.
import { loadEngine } from "dcloth";
import { Crowd } from "./crowd.js";
import { measureLevels } from "./costs.js";
import { Figure } from "./figure.js";
import { Motion } from "./motion.js";
import { Panel } from "./panel.js";
import { fetchSafetensors } from "./safetensors.js";
import { Stage } from "./stage.js";
import { Truth } from "./truth.js";

const LONGEST_FRAME = 0.1; // seconds: after a pause of the page the motion goes on where it was
const query = new URLSearchParams(location.search);

async function load() {
  const engine = await loadEngine({ kernels: /** @type {any} */ (query.get("kernels") ?? "auto") });
  const [model, character, ...sequences] = await Promise.all([
    engine.fetchModel("garment/skirt.dcloth"),
    fetchSafetensors("garment/character.safetensors"),
    fetchSafetensors("garment/walk_turn.safetensors"),
    fetchSafetensors("garment/run_stop.safetensors"),
  ]);
  const clips = sequences.map((sequence) => ({ motion: new Motion(sequence), truth: new Truth(sequence) }));
  return { engine, model, figure: new Figure(character), clips };
}

async function start() {
  const stage = new Stage(/** @type {HTMLCanvasElement} */ (document.getElementById("view")));
  /** @type {Crowd | null} */
  let crowd = null;
  const panel = new Panel(() => crowd?.apply(panel.settings));
  panel.read();
  try {
    const { engine, model, figure, clips } = await load();
    panel.introduce(engine, model);
    panel.say("Measuring this machine");
    const costs = await measureLevels(model, clips[0].motion, clips[0].truth);
    panel.showCosts(costs);
    crowd = new Crowd(engine, model, figure, clips, costs, stage);
    crowd.apply(panel.settings);
    panel.say("");
    return run(stage, panel, crowd, costs);
  } catch (error) {
    panel.say(String(error instanceof Error ? error.message : error), true);
    throw error;
  }
}

/** @type {(stage: Stage, panel: Panel, crowd: Crowd, costs: any) => any} */
function run(stage, panel, crowd, costs) {
  let last = performance.now(), shown = last, frames = 0, fps = 0, total = 0;
  /** @param {number} seconds */
  const step = (seconds) => {
    panel.record(crowd.update(seconds));
    ++total;
  };
  /** @param {number} now */
  const onFrame = (now) => {
    // The first frame's time may lie before the clock was read.
    const seconds = Math.min(Math.max(0, now - last) / 1000, LONGEST_FRAME);
    last = now;
    step(seconds);
    crowd.show();
    stage.draw();
    ++frames;
    if (now - shown > 300) {
      fps = (1000 * frames) / (now - shown);
      shown = now;
      frames = 0;
      panel.show(crowd.measure(), fps, crowd.levelCounts());
    }
  };
  const still = query.has("still");
  crowd.followsClock = !still;
  const loop = (now) => {
    try {
      onFrame(now);
    } catch (error) {
      stage.renderer.setAnimationLoop(null);
      panel.say(String(error), true);
      throw error;
    }
  };
  if (!still) stage.renderer.setAnimationLoop(loop);
  return {
    engine: crowd.engine,
    crowd,
    panel,
    costs,
    step,
    /** Draws what step() did. */
    draw() {
      crowd.show();
      stage.draw();
      panel.show(crowd.measure(), fps, crowd.levelCounts());
    },
    get updates() {
      return total;
    },
    get fps() {
      return fps;
    },
  };
}

/** @type {any} */ (globalThis).dclothPage = start();
