import { LEVELS } from "./costs.js";

export const LEVEL_COLORS = ["#b9b3a9", "#d9a441", "#3d9a8f", "#5b7fc7", "#7a4fb0"];
const HISTORY = 180;
const get = (id) => document.getElementById(id);

/** Sliders, figures and the table of levels. `settings` is what the user has set. */
export class Panel {
  #history = new Float32Array(HISTORY);
  #at = 0;
  #cells = [];

  /** @param {() => void} onChange */
  constructor(onChange) {
    this.settings = { characters: 1, budgetMs: 8, topLevel: 4, outsideBody: true };
    const read = () => {
      this.settings.characters = Number(get("characters").value);
      this.settings.budgetMs = Number(get("budget").value);
      const top = LEVELS[Number(get("level").value)];
      this.settings.topLevel = top.level;
      this.settings.outsideBody = get("outside").checked;
      get("characters-value").value = String(this.settings.characters);
      get("budget-value").value = `${this.settings.budgetMs.toFixed(1)} ms a frame`;
      get("level-value").value = top.name;
      onChange();
    };
    for (const id of ["characters", "budget", "level", "outside"]) get(id).addEventListener("input", read);
    this.read = read;
  }

  /** Sets sliders, and `outside`, as a user would. @param {Record<string, number | boolean>} values */
  set(values) {
    for (const [id, value] of Object.entries(values)) {
      if (id === "outside") get(id).checked = value;
      else get(id).value = String(value);
    }
    this.read();
  }

  /** @param {string} text @param {boolean} [isError] */
  say(text, isError = false) {
    get("message").textContent = text;
    get("message").classList.toggle("error", isError);
  }

  /** @param {import("dcloth").Engine} engine @param {import("dcloth").Model} model */
  introduce(engine, model) {
    const size = `${model.vertexCount.toLocaleString("en")} vertices each, ${model.precision}`;
    get("about").textContent = `${model.name}, ${size}; learned cloth on one thread of this page`;
    const slow = engine.instructionSet === "scalar";
    get("isa").textContent = slow ? `scalar fallback (${engine.fallback}): about ten times slower` : "WebAssembly SIMD";
    get("isa").classList.toggle("slow", slow);
  }

  /** @param {Awaited<ReturnType<typeof import("./costs.js").measureLevels>>} costs */
  showCosts(costs) {
    const ms = (microseconds) => (microseconds / 1000).toFixed(2);
    get("drawing").textContent = `Drawing takes ${ms(costs.drawMicroseconds)} ms in every frame, outside of the body ` +
      `${ms(costs.outsideMicroseconds)} ms.`;
    this.#cells = LEVELS.map(({ level, name }) => {
      const row = get("levels").insertRow();
      const head = row.insertCell();
      const dot = document.createElement("i");
      dot.style.background = LEVEL_COLORS[level];
      head.append(dot, name);
      for (const value of [costs.errorMm[level], costs.farMm[level], costs.tickMicroseconds[level] / 1000]) {
        row.insertCell().textContent = value.toFixed(2);
      }
      return { row, count: row.insertCell() };
    });
  }

  /** @param {number} ms of a frame's updates */
  record(ms) {
    this.#history[this.#at++ % HISTORY] = ms;
  }

  /** Figures of the last frames; a few times a second. @type {(mm: number, fps: number, counts: number[]) => void} */
  show(mm, fps, counts) {
    const known = Math.min(this.#at, 60);
    let sum = 0;
    for (let i = 1; i <= known; ++i) sum += this.#history[(this.#at - i) % HISTORY];
    get("ms").textContent = (sum / Math.max(1, known)).toFixed(1);
    get("mm").textContent = Number.isNaN(mm) ? "–" : mm.toFixed(1);
    get("fps").textContent = fps > 0 ? fps.toFixed(fps < 10 ? 1 : 0) : "–";
    this.#cells.forEach(({ row, count }, i) => {
      const { level } = LEVELS[i];
      count.textContent = String(counts[level]);
      row.classList.toggle("unused", counts[level] === 0);
    });
    this.#drawHistory();
  }

  #drawHistory() {
    const canvas = get("history"), ratio = Math.min(devicePixelRatio, 2);
    const width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const known = Math.min(this.#at, HISTORY), budget = this.settings.budgetMs;
    let top = budget * 1.25;
    for (let i = 0; i < known; ++i) top = Math.max(top, this.#history[i] * 1.05);
    const step = width / HISTORY;
    for (let i = 1; i <= known; ++i) {
      const ms = this.#history[(this.#at - i) % HISTORY];
      const tall = (height * ms) / top;
      context.fillStyle = ms > budget ? "#d98b5f" : "#2f6f73";
      context.fillRect(width - i * step, height - tall, Math.max(1, step - 0.5), tall);
    }
    context.strokeStyle = "#b0a89b";
    context.setLineDash([4, 3]);
    context.beginPath();
    context.moveTo(0, height - (height * budget) / top);
    context.lineTo(width, height - (height * budget) / top);
    context.stroke();
  }
}
