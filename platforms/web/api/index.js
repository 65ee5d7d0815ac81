// dcloth for the web: learned cloth in WebAssembly. The contract of each call is dcloth.h's; memory is lent in here.
import * as abi from "./abi.js";

export { Engine, loadEngine } from "./engine.js";
export { Model } from "./model.js";
export { Cloth } from "./cloth.js";
export { Scene } from "./scene.js";
export { Timer, STEPS } from "./timer.js";
export { DClothError } from "./error.js";
export { hasSimd } from "./simd.js";

/** Which stages run; fewer are a level of detail. */
export const Stages = Object.freeze({
  STATIC: abi.DCLOTH_STAGES_STATIC,
  SKELETON: abi.DCLOTH_STAGES_SKELETON,
  MESH: abi.DCLOTH_STAGES_MESH,
});

/** Of an update; to be combined by |. */
export const FrameFlags = Object.freeze({
  PIPELINED: abi.DCLOTH_FRAME_PIPELINED,
  JUMPED: abi.DCLOTH_FRAME_JUMPED,
  HOLD: abi.DCLOTH_FRAME_HOLD,
  FREEZE_IDLE: abi.DCLOTH_FRAME_FREEZE_IDLE,
});

/** What a scene gives a character. */
export const Levels = Object.freeze({
  FROZEN: abi.DCLOTH_LEVEL_FROZEN,
  STATIC: abi.DCLOTH_LEVEL_STATIC,
  SKELETON: abi.DCLOTH_LEVEL_SKELETON,
  MESH: abi.DCLOTH_LEVEL_MESH,
});

/** How a frame is drawn: Cloth.update and Scene.draw. */
export const Draw = Object.freeze({
  NONE: abi.DCLOTH_DRAW_NONE,
  COARSE: abi.DCLOTH_DRAW_COARSE,
  POSITIONS: abi.DCLOTH_DRAW_POSITIONS,
  FULL: abi.DCLOTH_DRAW_FULL,
  PLAIN: abi.DCLOTH_DRAW_PLAIN,
});

/** Where the character's left, up or forward points. */
export const Axis = Object.freeze({
  X: abi.DCLOTH_AXIS_X,
  MINUS_X: abi.DCLOTH_AXIS_MINUS_X,
  Y: abi.DCLOTH_AXIS_Y,
  MINUS_Y: abi.DCLOTH_AXIS_MINUS_Y,
  Z: abi.DCLOTH_AXIS_Z,
  MINUS_Z: abi.DCLOTH_AXIS_MINUS_Z,
});

/** Which part of the body a joint moves; `Character.jointRoles` where names do not say. */
export const Roles = Object.freeze({
  NONE: abi.DCLOTH_ROLE_NONE,
  HIPS: abi.DCLOTH_ROLE_HIPS,
  SPINE: abi.DCLOTH_ROLE_SPINE,
  CHEST: abi.DCLOTH_ROLE_CHEST,
  UPPER_CHEST: abi.DCLOTH_ROLE_UPPER_CHEST,
  NECK: abi.DCLOTH_ROLE_NECK,
  HEAD: abi.DCLOTH_ROLE_HEAD,
  LEFT_SHOULDER: abi.DCLOTH_ROLE_LEFT_SHOULDER,
  LEFT_UPPER_ARM: abi.DCLOTH_ROLE_LEFT_UPPER_ARM,
  LEFT_LOWER_ARM: abi.DCLOTH_ROLE_LEFT_LOWER_ARM,
  LEFT_HAND: abi.DCLOTH_ROLE_LEFT_HAND,
  RIGHT_SHOULDER: abi.DCLOTH_ROLE_RIGHT_SHOULDER,
  RIGHT_UPPER_ARM: abi.DCLOTH_ROLE_RIGHT_UPPER_ARM,
  RIGHT_LOWER_ARM: abi.DCLOTH_ROLE_RIGHT_LOWER_ARM,
  RIGHT_HAND: abi.DCLOTH_ROLE_RIGHT_HAND,
  LEFT_UPPER_LEG: abi.DCLOTH_ROLE_LEFT_UPPER_LEG,
  LEFT_LOWER_LEG: abi.DCLOTH_ROLE_LEFT_LOWER_LEG,
  LEFT_FOOT: abi.DCLOTH_ROLE_LEFT_FOOT,
  LEFT_TOES: abi.DCLOTH_ROLE_LEFT_TOES,
  RIGHT_UPPER_LEG: abi.DCLOTH_ROLE_RIGHT_UPPER_LEG,
  RIGHT_LOWER_LEG: abi.DCLOTH_ROLE_RIGHT_LOWER_LEG,
  RIGHT_FOOT: abi.DCLOTH_ROLE_RIGHT_FOOT,
  RIGHT_TOES: abi.DCLOTH_ROLE_RIGHT_TOES,
});
