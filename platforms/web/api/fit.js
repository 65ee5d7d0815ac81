import * as abi from "./abi.js";

/** @typedef {import("./engine.js").Engine} Engine */
/** @typedef {import("./model.js").Model} Model */

/**
 * The skin of a character in its bind pose.
 * @typedef {Object} Body
 * @property {ArrayLike<number>} positions [n, 3] in the world
 * @property {ArrayLike<number>} joints [n, influences] indices of joints
 * @property {ArrayLike<number>} weights [n, influences], 0 or more
 * @property {number} [influences] 1 to 16; 4 where not said, as in glTF and three.js
 * @property {ArrayLike<number>} [triangles] [t, 3]; without them the points must lie close to each other
 */

/**
 * A character that the garment was not trained on, in its bind pose: a standing T or A pose. See dcloth_character.
 * @typedef {Object} Character
 * @property {readonly string[]} jointNames the whole skeleton; `Cloth.pose` then holds one matrix per name
 * @property {ArrayLike<number>} bindMatrices [jointCount, 16] joint to world, rows or columns as in `Cloth.pose`
 * @property {readonly number[]} [jointRoles] of `Roles`; NONE or absent: by the joint's name
 * @property {Body} [body] the garment's cut and the surface of `outsideBody` are moved onto this skin
 */

/**
 * How a garment fits. Lengths are real metres or millimetres of the character; see dcloth_fit.
 * @typedef {Object} Fit
 * @property {string[]} warnings why it may not look right, such as "girth"; empty for a good fit
 * @property {number} scale the garment is drawn this many times the size it was trained at
 * @property {number} boneScale by bones alone
 * @property {number} waistRatio waist over the figure's at boneScale; 0 without a body
 * @property {number} hipsRatio
 * @property {number} gapMm mean distance to the skin at rest of the parts closest to it; 0 without a body
 * @property {number} penetrationMm how far skin stands out at the worst vertex at rest; 0 without a body
 * @property {number} penetratingShare of vertices near the skin, with skin more than 1 mm outside of them
 * @property {number} stanceDegrees largest turn of a limb between the two bind poses
 * @property {string} stanceRole of that limb
 * @property {string} standInRole first part whose joint is another's; "none" where there is none
 * @property {Map<string, number>} joints role, such as "left upper leg" -> index of the character's joint
 * @property {Map<string, number>} ratios role -> length of its bone over the scaled figure's
 */

const WARNINGS = ["stand_in", "proportions", "stance", "girth", "gap", "penetration", "facing"];

/**
 * Calls dcloth_cloth_fit. Errors: DClothError JOINTS, POSE, ARGUMENT, MEMORY with the engine's text; Error where a
 * length of an array is not what the others ask for.
 * @param {Model} model
 * @param {number} cloth its address
 * @param {Character} character
 * @param {boolean} columnMajor
 * @returns {{ fit: Fit, storage: number }} storage: lent, to be given back after the cloth
 */
export function fitCloth(model, cloth, character, columnMajor) {
  const { engine } = model;
  const { exports, memory } = engine;
  const { jointNames, jointRoles, bindMatrices, body } = character;
  const joints = jointNames.length;
  checkLength(model, "bindMatrices", bindMatrices, 16 * joints);
  if (jointRoles !== undefined) checkLength(model, "jointRoles", jointRoles, joints);
  const influences = body?.influences ?? 4, vertices = body ? body.positions.length / 3 : 0;
  if (body !== undefined) {
    checkLength(model, "body.joints", body.joints, vertices * influences);
    checkLength(model, "body.weights", body.weights, vertices * influences);
  }
  const words = [bindMatrices, jointRoles, body?.positions, body?.joints, body?.weights, body?.triangles];
  const at = abi.dcloth_character;
  const bytes = at.bytes + abi.dcloth_fit.bytes + words.reduce((sum, array) => sum + 4 * (array?.length ?? 0), 0);
  return memory.withNames(jointNames, (names) => memory.withBlock(bytes, (told) => {
    const fit = told + at.bytes;
    let next = fit + abi.dcloth_fit.bytes;
    const copies = words.map((array, i) => {
      if (array === undefined || array.length === 0) return 0;
      const integers = i === 1 || i === 3 || i === 5;
      (integers ? memory.u32 : memory.f32).set(array, next / 4);
      next += 4 * array.length;
      return next - 4 * array.length;
    });
    /** @type {(offset: number, value: number) => void} */
    const put = (offset, value) => {
      memory.u32[(told + offset) / 4] = value;
    };
    put(at.struct_size, at.bytes);
    put(at.joint_count, joints);
    put(at.joint_names, names);
    put(at.bind_matrices, copies[0]);
    put(at.joint_roles, copies[1]);
    put(at.column_major, columnMajor ? 1 : 0);
    put(at.body_vertex_count, vertices);
    put(at.body_positions, copies[2]);
    put(at.body_joints, copies[3]);
    put(at.body_weights, copies[4]);
    put(at.body_triangles, copies[5]);
    put(at.body_influences, body ? influences : 0);
    put(at.body_triangle_count, (body?.triangles?.length ?? 0) / 3);
    memory.u32[(fit + abi.dcloth_fit.struct_size) / 4] = abi.dcloth_fit.bytes;
    const size = exports.dcloth_fit_storage_size(model.address, told);
    const storage = memory.lend(size);
    try {
      memory.check(model.name, (error) => exports.dcloth_cloth_fit(cloth, told, storage, size, fit, error));
    } catch (error) {
      memory.giveBack(storage);
      throw error;
    }
    return { fit: read(engine, fit), storage };
  }));
}

/**
 * @param {Engine} engine
 * @param {number} at of a dcloth_fit
 * @returns {Fit}
 */
function read({ exports, memory }, at) {
  const of = abi.dcloth_fit;
  /** @param {number} offset */
  const real = (offset) => memory.f32[(at + offset) / 4];
  /** @param {number} offset */
  const whole = (offset) => memory.u32[(at + offset) / 4];
  /** @param {number} role */
  const name = (role) => memory.text(exports.dcloth_role_name(role));
  const joints = new Map(), ratios = new Map();
  for (let role = 1; role < abi.DCLOTH_FIT_ROLES && name(role) !== ""; ++role) {
    const joint = whole(of.joints + 4 * role) | 0, ratio = real(of.ratios + 4 * role);
    if (joint >= 0) joints.set(name(role), joint);
    if (ratio !== 0) ratios.set(name(role), ratio);
  }
  return {
    warnings: WARNINGS.filter((_, bit) => (whole(of.warnings) >> bit) & 1),
    scale: real(of.scale), boneScale: real(of.bone_scale),
    waistRatio: real(of.waist_ratio), hipsRatio: real(of.hips_ratio),
    gapMm: real(of.gap_mm), penetrationMm: real(of.penetration_mm), penetratingShare: real(of.penetrating_share),
    stanceDegrees: real(of.stance_degrees), stanceRole: name(whole(of.stance_role)),
    standInRole: name(whole(of.stand_in_role)), joints, ratios,
  };
}

/**
 * @param {Model} model
 * @param {string} what
 * @param {ArrayLike<number>} array
 * @param {number} expected
 */
function checkLength(model, what, array, expected) {
  if (array.length === expected) return;
  throw new Error(`dcloth: ${model.name}: character.${what} has ${array.length} numbers; allowed: ${expected}`);
}
