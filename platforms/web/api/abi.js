// Made by platforms/web/generate_abi.py from engine/abi.json; a test compares. Not edited by hand.
// Offsets are bytes on wasm32; the build checks them against the compiler's.

export const DCLOTH_VERSION_MAJOR = 0;
export const DCLOTH_VERSION_MINOR = 2;
export const DCLOTH_VERSION_PATCH = 0;
export const DCLOTH_VERSION_NUMBER = 2000;
export const DCLOTH_ALIGNMENT = 64;
export const DCLOTH_MAX_TICKS = 2;
export const DCLOTH_TIMER_STEPS = 8;
export const DCLOTH_FIT_ROLES = 32;
export const DCLOTH_SCENE_LEVELS = 5;
export const DCLOTH_OK = 0;
export const DCLOTH_ERROR_ARGUMENT = 1;
export const DCLOTH_ERROR_ALIGNMENT = 2;
export const DCLOTH_ERROR_MEMORY = 3;
export const DCLOTH_ERROR_FORMAT = 4;
export const DCLOTH_ERROR_VERSION = 5;
export const DCLOTH_ERROR_SEMANTICS = 6;
export const DCLOTH_ERROR_POSE = 7;
export const DCLOTH_ERROR_JOINTS = 8;
export const DCLOTH_ERROR_MODEL = 9;
export const DCLOTH_STAGES_STATIC = 1;
export const DCLOTH_STAGES_SKELETON = 3;
export const DCLOTH_STAGES_MESH = 7;
export const DCLOTH_AXIS_X = 0;
export const DCLOTH_AXIS_MINUS_X = 1;
export const DCLOTH_AXIS_Y = 2;
export const DCLOTH_AXIS_MINUS_Y = 3;
export const DCLOTH_AXIS_Z = 4;
export const DCLOTH_AXIS_MINUS_Z = 5;
export const DCLOTH_JOINT_FRAMES_CONVERTED = 0;
export const DCLOTH_JOINT_FRAMES_KEPT = 1;
export const DCLOTH_FRAME_PIPELINED = 1;
export const DCLOTH_FRAME_JUMPED = 2;
export const DCLOTH_FRAME_HOLD = 8;
export const DCLOTH_FRAME_FREEZE_IDLE = 16;
export const DCLOTH_FORMAT_FLOAT32 = 0;
export const DCLOTH_FORMAT_FLOAT16 = 1;
export const DCLOTH_OUTPUT_OUTSIDE_BODY = 1;
export const DCLOTH_OUTPUT_COARSE = 2;
export const DCLOTH_OUTPUT_TEXTURED = 4;
export const DCLOTH_STEP_POSE = 0;
export const DCLOTH_STEP_STATIC = 1;
export const DCLOTH_STEP_SKELETON = 2;
export const DCLOTH_STEP_MESH = 3;
export const DCLOTH_STEP_DISPLACEMENT = 4;
export const DCLOTH_STEP_SKINNING = 5;
export const DCLOTH_STEP_NORMALS = 6;
export const DCLOTH_STEP_PENETRATION = 7;
export const DCLOTH_STEP_COUNT = 8;
export const DCLOTH_JOINT_TOP = -1;
export const DCLOTH_JOINT_UNKNOWN = -2;
export const DCLOTH_RESTORE_OTHER_MODEL = 1;
export const DCLOTH_ROLE_NONE = 0;
export const DCLOTH_ROLE_HIPS = 1;
export const DCLOTH_ROLE_SPINE = 2;
export const DCLOTH_ROLE_CHEST = 3;
export const DCLOTH_ROLE_UPPER_CHEST = 4;
export const DCLOTH_ROLE_NECK = 5;
export const DCLOTH_ROLE_HEAD = 6;
export const DCLOTH_ROLE_LEFT_SHOULDER = 7;
export const DCLOTH_ROLE_LEFT_UPPER_ARM = 8;
export const DCLOTH_ROLE_LEFT_LOWER_ARM = 9;
export const DCLOTH_ROLE_LEFT_HAND = 10;
export const DCLOTH_ROLE_RIGHT_SHOULDER = 11;
export const DCLOTH_ROLE_RIGHT_UPPER_ARM = 12;
export const DCLOTH_ROLE_RIGHT_LOWER_ARM = 13;
export const DCLOTH_ROLE_RIGHT_HAND = 14;
export const DCLOTH_ROLE_LEFT_UPPER_LEG = 15;
export const DCLOTH_ROLE_LEFT_LOWER_LEG = 16;
export const DCLOTH_ROLE_LEFT_FOOT = 17;
export const DCLOTH_ROLE_LEFT_TOES = 18;
export const DCLOTH_ROLE_RIGHT_UPPER_LEG = 19;
export const DCLOTH_ROLE_RIGHT_LOWER_LEG = 20;
export const DCLOTH_ROLE_RIGHT_FOOT = 21;
export const DCLOTH_ROLE_RIGHT_TOES = 22;
export const DCLOTH_FIT_STAND_IN = 1;
export const DCLOTH_FIT_PROPORTIONS = 2;
export const DCLOTH_FIT_STANCE = 4;
export const DCLOTH_FIT_GIRTH = 8;
export const DCLOTH_FIT_GAP = 16;
export const DCLOTH_FIT_PENETRATION = 32;
export const DCLOTH_FIT_FACING = 64;
export const DCLOTH_LEVEL_FROZEN = 0;
export const DCLOTH_LEVEL_STATIC = 1;
export const DCLOTH_LEVEL_SKELETON = 2;
export const DCLOTH_LEVEL_MESH = 4;
export const DCLOTH_LEVEL_COUNT = 5;
export const DCLOTH_DRAW_NONE = 0;
export const DCLOTH_DRAW_COARSE = 1;
export const DCLOTH_DRAW_POSITIONS = 2;
export const DCLOTH_DRAW_FULL = 3;
export const DCLOTH_DRAW_PLAIN = 4;
export const DCLOTH_DRAW_COUNT = 5;

export const dcloth_character = Object.freeze({
  bytes: 52,
  struct_size: 0,
  joint_count: 4,
  joint_names: 8,
  joint_roles: 12,
  bind_matrices: 16,
  column_major: 20,
  body_vertex_count: 24,
  body_positions: 28,
  body_joints: 32,
  body_weights: 36,
  body_triangles: 40,
  body_influences: 44,
  body_triangle_count: 48,
});

export const dcloth_cloth_info = Object.freeze({
  bytes: 24,
  struct_size: 0,
  in_work: 4,
  lag_seconds: 8,
  tick_share: 12,
  frozen: 16,
  tick_waits: 20,
});

export const dcloth_error = Object.freeze({
  bytes: 272,
  struct_size: 0,
  status: 4,
  offset_bytes: 8,
  text: 16,
  what_at: 256,
  what_size: 258,
  found_at: 260,
  found_size: 262,
  allowed_at: 264,
  allowed_size: 266,
  mend_at: 268,
  mend_size: 270,
});

export const dcloth_fit = Object.freeze({
  bytes: 312,
  struct_size: 0,
  warnings: 4,
  scale: 8,
  bone_scale: 12,
  waist_ratio: 16,
  hips_ratio: 20,
  gap_mm: 24,
  penetration_mm: 28,
  penetrating_share: 32,
  stance_degrees: 36,
  stance_role: 40,
  stand_in_role: 44,
  ratios: 48,
  joints: 176,
  file_bytes: 304,
});

export const dcloth_frame = Object.freeze({
  bytes: 20,
  struct_size: 0,
  stages: 4,
  seconds: 8,
  flags: 12,
  error: 16,
});

export const dcloth_model_info = Object.freeze({
  bytes: 84,
  struct_size: 0,
  joint_count: 4,
  vertex_count: 8,
  triangle_count: 12,
  stages: 16,
  tick_seconds: 20,
  format_major: 24,
  format_minor: 28,
  name: 32,
  precision: 36,
  triangles: 40,
  positions: 44,
  coarse_vertices: 48,
  coarse_triangles: 52,
  coarse_vertex_count: 56,
  coarse_triangle_count: 60,
  texture_coordinates: 64,
  textured_triangles: 68,
  seam_vertices: 72,
  textured_vertex_count: 76,
  seam_vertex_count: 80,
});

export const dcloth_output = Object.freeze({
  bytes: 72,
  struct_size: 0,
  vertex_count: 4,
  positions: 8,
  position_stride_bytes: 12,
  normal_stride_bytes: 16,
  normals: 20,
  tangents: 24,
  texture_coordinates: 28,
  tangent_stride_bytes: 32,
  texture_stride_bytes: 36,
  position_format: 40,
  normal_format: 44,
  tangent_format: 48,
  flags: 52,
  bounds: 56,
  scratch: 60,
  scratch_size: 64,
});

export const dcloth_pose = Object.freeze({
  bytes: 20,
  struct_size: 0,
  joint_count: 4,
  joint_matrices: 8,
  column_major: 12,
  padding: 16,
});

export const dcloth_scene_character = Object.freeze({
  bytes: 84,
  struct_size: 0,
  top_level: 4,
  cloth: 8,
  importance: 12,
  draw_microseconds: 16,
  tick_microseconds: 20,
  error_mm: 40,
  positions_microseconds: 60,
  coarse_microseconds: 64,
  undrawn_microseconds: 68,
  most_undrawn: 72,
  plain_microseconds: 76,
  padding: 80,
});

export const dcloth_scene_choice = Object.freeze({
  bytes: 32,
  struct_size: 0,
  level: 4,
  stages: 8,
  flags: 12,
  ticks: 16,
  microseconds: 20,
  stale_seconds: 24,
  draw: 28,
});

export const dcloth_scene_frame = Object.freeze({
  bytes: 16,
  struct_size: 0,
  seconds: 4,
  budget_microseconds: 8,
  spent_microseconds: 12,
});

export const dcloth_space = Object.freeze({
  bytes: 24,
  struct_size: 0,
  left: 4,
  up: 8,
  forward: 12,
  metres_per_unit: 16,
  joint_frames: 20,
});

export const dcloth_timer = Object.freeze({
  bytes: 88,
  struct_size: 0,
  now: 4,
  context: 8,
  elapsed: 16,
  piece: 80,
});

/**
 * What the module exports; pointers and size_t are numbers.
 * @typedef {Object} Exports
 * @property {WebAssembly.Memory} memory
 * @property {(alignment: number, size: number) => number} aligned_alloc
 * @property {(address: number) => void} free
 * @property {() => number} dcloth_web_clock_address
 * @property {(cloth: number, names: number, count: number, error: number) => number} dcloth_cloth_bind_joints
 * @property {(model: number, storage: number, storage_size: number, cloth: number, error: number)
 *   => number} dcloth_cloth_create
 * @property {(cloth: number, info: number) => number} dcloth_cloth_describe
 * @property {(cloth: number, character: number, storage: number, storage_size: number, fit: number, error: number)
 *   => number} dcloth_cloth_fit
 * @property {(cloth: number) => number} dcloth_cloth_reset
 * @property {(cloth: number, state: number, size: number, flags: number, error: number) => number} dcloth_cloth_restore
 * @property {(cloth: number, state: number, size: number, error: number) => number} dcloth_cloth_save
 * @property {(cloth: number, bind: number, error: number) => number} dcloth_cloth_set_bind_pose
 * @property {(cloth: number, fit: number, size: number, error: number) => number} dcloth_cloth_set_fit
 * @property {(cloth: number, space: number, error: number) => number} dcloth_cloth_set_space
 * @property {(cloth: number, wind: number, error: number) => number} dcloth_cloth_set_wind
 * @property {(cloth: number, pose: number, blend: number, output: number, timer: number) => number} dcloth_cloth_skin
 * @property {(cloth: number) => number} dcloth_cloth_state_size
 * @property {(model: number) => number} dcloth_cloth_storage_size
 * @property {(cloth: number, pose: number, stages: number, timer: number) => number} dcloth_cloth_tick
 * @property {(cloth: number, pose: number, frame: number, output: number, timer: number) => number} dcloth_cloth_update
 * @property {(model: number, character: number) => number} dcloth_fit_storage_size
 * @property {() => number} dcloth_isa_name
 * @property {(name: number) => number} dcloth_isa_select
 * @property {(model: number) => number} dcloth_model_body_vertex_count
 * @property {(model: number, info: number) => number} dcloth_model_describe
 * @property {(model: number, index: number, matrix: number) => number} dcloth_model_joint_bind
 * @property {(model: number, index: number) => number} dcloth_model_joint_name
 * @property {(model: number, index: number) => number} dcloth_model_joint_parent
 * @property {(bytes: number, size: number, storage: number, storage_size: number, model: number, error: number)
 *   => number} dcloth_model_open
 * @property {(model: number, output: number) => number} dcloth_model_output
 * @property {(model: number) => number} dcloth_model_reads_wind
 * @property {() => number} dcloth_model_storage_size
 * @property {(output: number) => bigint} dcloth_output_scratch_size
 * @property {(role: number) => number} dcloth_role_name
 * @property {(name: number) => number} dcloth_role_of_name
 * @property {(character_count: number, storage: number, storage_size: number, scene: number, error: number)
 *   => number} dcloth_scene_create
 * @property {(scene: number, index: number, choice: number) => number} dcloth_scene_get
 * @property {(scene: number, frame: number, planned_microseconds: number) => number} dcloth_scene_plan
 * @property {(scene: number, index: number, character: number) => number} dcloth_scene_set
 * @property {(scene: number, index: number, importance: number) => number} dcloth_scene_set_importance
 * @property {(character_count: number) => number} dcloth_scene_storage_size
 * @property {(status: number) => number} dcloth_status_name
 * @property {() => number} dcloth_version
 * @property {() => number} dcloth_version_number
 */
