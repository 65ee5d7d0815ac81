import * as THREE from "three";
import { Levels } from "dcloth";
import { Character } from "./character.js";
import { LEVEL_COLORS } from "./panel.js";

const SPACING = 1.42; // metres
const COLORS = [0x2b6468, 0xa9553a, 0x3f4f86, 0xb98a35, 0x66784a, 0x743f5b, 0x47789a, 0x8c4640];
const START_SHARES = 0.381966; // of the motion's length from one character to the next: no two look alike for long

/** All characters and the plan that keeps them in the budget. */
export class Crowd {
  /** @type {Character[]} */ characters = [];
  /** Plans follow what updates really took; false: the costs as they were measured. */
  followsClock = true;
  #scene = null;
  #settings = null;
  #spent = 0;
  #measured = 0;
  #point = new THREE.Vector3();

  /**
   * @param {import("dcloth").Engine} engine
   * @param {import("dcloth").Model} model
   * @param {import("./figure.js").Figure} figure
   * @param {{ motion: import("./motion.js").Motion, truth: import("./truth.js").Truth }[]} clips
   * @param {any} costs of measureLevels
   * @param {import("./stage.js").Stage} stage
   */
  constructor(engine, model, figure, clips, costs, stage) {
    Object.assign(this, { engine, model, figure, clips, costs, stage });
  }

  /** @param {{ characters: number, budgetMs: number, topLevel: number, outsideBody: boolean }} settings */
  apply(settings) {
    const before = this.#settings;
    this.#settings = { ...settings };
    const { characters, stage } = this;
    this.#scene?.dispose();
    while (characters.length > settings.characters) characters.pop().dispose();
    while (characters.length < settings.characters) characters.push(this.#create(characters.length));
    this.#scene = this.engine.createScene(characters.length);
    const outsideCount = settings.outsideBody ? this.#outsideCount() : 0;
    // Levels are ranked by how far they are from the whole network. To the truth this skirt's mesh stage comes no
    // nearer: by that error the plan would never choose it, and there would be nothing to see of it.
    characters.forEach((character, i) => {
      const outside = i < outsideCount;
      character.cloth.outsideBody = outside;
      this.#scene.set(i, {
        cloth: character.cloth, importance: 1, topLevel: settings.topLevel,
        drawMicroseconds: outside ? this.costs.outsideMicroseconds : this.costs.drawMicroseconds,
        tickMicroseconds: this.costs.tickMicroseconds, errorMm: this.costs.farMm });
    });
    this.#spent = 0;
    if (before?.characters !== settings.characters) {
      const { width, depth } = this.#arrange();
      stage.frame(width, depth);
    }
  }

  /**
   * Moves all characters on and updates their cloth; milliseconds that the cloth took.
   * @param {number} seconds
   */
  update(seconds) {
    const { characters, stage } = this;
    for (let i = 0; i < characters.length; ++i) {
      characters[i].advance(seconds);
      // The share of the screen.
      const distance = this.#point.copy(characters[i].group.position).setY(0.8).distanceTo(stage.camera.position);
      this.#scene.setImportance(i, 1 / (distance * distance));
    }
    const start = performance.now();
    this.#scene.plan(seconds, 1000 * this.#settings.budgetMs, this.#spent);
    for (let i = 0; i < characters.length; ++i) {
      characters[i].cloth.update(seconds, this.#scene.stages(i), this.#scene.flags(i));
    }
    const ms = performance.now() - start;
    if (this.followsClock) this.#spent = 1000 * ms;
    return ms;
  }

  show() {
    this.characters.forEach((character, i) => {
      character.show();
      character.disc.rim.material.color.set(LEVEL_COLORS[this.#scene.level(i)]);
    });
    // One distance a frame is enough for a mean that is read a few times a second.
    this.characters[this.#measured++ % this.characters.length].measure();
  }

  /** Mean distance to the truth in millimetres, of all characters that were measured. */
  measure() {
    const known = this.characters.map((character) => character.errorMm).filter((mm) => !Number.isNaN(mm));
    return known.length === 0 ? NaN : known.reduce((sum, mm) => sum + mm, 0) / known.length;
  }

  levelCounts() {
    const counts = new Array(Levels.MESH + 1).fill(0);
    this.characters.forEach((_, i) => ++counts[this.#scene.level(i)]);
    return counts;
  }

  /** To stay outside costs more than all other drawing, in every frame: as many as half of the budget holds get it. */
  #outsideCount() {
    const { drawMicroseconds, outsideMicroseconds } = this.costs;
    const left = 500 * this.#settings.budgetMs - this.characters.length * drawMicroseconds;
    return Math.floor(left / Math.max(1, outsideMicroseconds - drawMicroseconds));
  }

  /** @param {number} index */
  #create(index) {
    const clip = this.clips[index % this.clips.length];
    const character = new Character(this.model, this.figure, clip, {
      color: COLORS[index % COLORS.length],
      startSeconds: (index * START_SHARES * clip.motion.seconds) % clip.motion.seconds });
    this.stage.scene.add(character.group);
    return character;
  }

  /** Rows, the first character in the middle of the front one. */
  #arrange() {
    const count = this.characters.length;
    const columns = Math.min(count, Math.max(3, Math.ceil(Math.sqrt(count * 1.6)))), rows = Math.ceil(count / columns);
    this.characters.forEach((character, i) => {
      const row = Math.floor(i / columns), inRow = Math.min(columns, count - row * columns);
      const place = i % columns, side = place % 2 === 0 ? place / 2 : -(place + 1) / 2; // 0, -1, 1, -2, 2
      const even = inRow % 2 === 0 ? 0.5 : 0, stagger = row % 2 === 1 && inRow % 2 === columns % 2 ? 0.5 : 0;
      character.group.position.set((side + even + stagger) * SPACING, 0, ((rows - 1) / 2 - row) * SPACING);
    });
    return { width: (columns - 1) * SPACING, depth: (rows - 1) * SPACING };
  }
}
