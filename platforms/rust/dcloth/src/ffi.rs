//! The C ABI as Rust sees it. The test at the end compares every declaration with `engine/abi.json`.
#![allow(non_camel_case_types, missing_docs)]

use std::ffi::{c_char, c_void};

pub type dcloth_status = i32;

/// Declares structs as C lays them out, and lists their fields for the test.
macro_rules! structs {
    ($(struct $name:ident { $($field:ident: $type:ty,)* })*) => {
        $(
            #[repr(C)]
            pub struct $name { $(pub $field: $type,)* }

            impl $name {
                /// All zero, and `struct_size` set.
                pub const fn new() -> Self {
                    // SAFETY: every field is a number, an array of numbers or a raw pointer; zero is a value of each.
                    let mut zero: Self = unsafe { std::mem::zeroed() };
                    zero.struct_size = size_of::<Self>() as u32;
                    zero
                }
            }
        )*

        #[cfg(test)]
        pub const STRUCTS: &[Struct] = &[$(Struct {
            name: stringify!($name),
            bytes: size_of::<$name>(),
            fields: &[$((stringify!($field), std::mem::offset_of!($name, $field), {
                const fn bytes<T, F>(_: fn(&T) -> &F) -> usize { size_of::<F>() }
                bytes(|whole: &$name| &whole.$field)
            }, stringify!($type)),)*],
        },)*];
    };
}

/// Declares functions, and lists their types for the test.
macro_rules! functions {
    ($(fn $name:ident($($argument:ident: $type:ty),*) -> $result:ty;)*) => {
        unsafe extern "C" {
            $(pub fn $name($($argument: $type),*) -> $result;)*
        }

        #[cfg(test)]
        pub const FUNCTIONS: &[Function] = &[$((stringify!($name), stringify!($result),
            &[$((stringify!($argument), stringify!($type)),)*]),)*];
    };
}

macro_rules! constants {
    ($($name:ident: $type:ty = $value:expr;)*) => {
        // All of the header's, so that a test holds the list against abi.json; coarse meshes are not wrapped so far.
        $(#[allow(dead_code)] pub const $name: $type = $value;)*

        #[cfg(test)]
        pub const CONSTANTS: &[(&str, i64)] = &[$((stringify!($name), $name as i64),)*];
    };
}

#[cfg(test)]
pub struct Struct {
    pub name: &'static str,
    pub bytes: usize,
    pub fields: &'static [(&'static str, usize, usize, &'static str)], // name, offset, bytes, type
}
#[cfg(test)]
pub type Function = (&'static str, &'static str, &'static [(&'static str, &'static str)]); // name, result, arguments

#[repr(C)]
pub struct dcloth_model {
    _opaque: [u8; 0],
}
#[repr(C)]
pub struct dcloth_cloth {
    _opaque: [u8; 0],
}
/// Never passed: the crate has no timers.
pub type dcloth_timer = c_void;

structs! {
    struct dcloth_error {
        struct_size: u32,
        status: dcloth_status,
        offset_bytes: u64,
        text: [c_char; 240],
        what_at: u16,
        what_size: u16,
        found_at: u16,
        found_size: u16,
        allowed_at: u16,
        allowed_size: u16,
        mend_at: u16,
        mend_size: u16,
    }
    struct dcloth_model_info {
        struct_size: u32,
        joint_count: u32,
        vertex_count: u32,
        triangle_count: u32,
        stages: u32,
        tick_seconds: f32,
        format_major: u32,
        format_minor: u32,
        name: *const c_char,
        precision: *const c_char,
        triangles: *const u16,
        positions: *const f32,
        coarse_vertices: *const u16,
        coarse_triangles: *const u16,
        coarse_vertex_count: u32,
        coarse_triangle_count: u32,
        texture_coordinates: *const f32,
        textured_triangles: *const u16,
        seam_vertices: *const u16,
        textured_vertex_count: u32,
        seam_vertex_count: u32,
    }
    struct dcloth_space {
        struct_size: u32,
        left: u32,
        up: u32,
        forward: u32,
        metres_per_unit: f32,
        joint_frames: u32,
    }
    struct dcloth_pose {
        struct_size: u32,
        joint_count: u32,
        joint_matrices: *const f32,
        column_major: u32,
        padding: u32,
    }
    struct dcloth_frame {
        struct_size: u32,
        stages: u32,
        seconds: f32,
        flags: u32,
        error: *mut dcloth_error,
    }
    struct dcloth_cloth_info {
        struct_size: u32,
        in_work: u32,
        lag_seconds: f32,
        tick_share: f32,
        frozen: u32,
        tick_waits: u32,
    }
    struct dcloth_output {
        struct_size: u32,
        vertex_count: u32,
        positions: *mut c_void,
        position_stride_bytes: u32,
        normal_stride_bytes: u32,
        normals: *mut c_void,
        tangents: *mut c_void,
        texture_coordinates: *const f32,
        tangent_stride_bytes: u32,
        texture_stride_bytes: u32,
        position_format: u32,
        normal_format: u32,
        tangent_format: u32,
        flags: u32,
        bounds: *mut f32,
        scratch: *mut c_void,
        scratch_size: u64,
    }
    struct dcloth_character {
        struct_size: u32,
        joint_count: u32,
        joint_names: *const *const c_char,
        joint_roles: *const u32,
        bind_matrices: *const f32,
        column_major: u32,
        body_vertex_count: u32,
        body_positions: *const f32,
        body_joints: *const u32,
        body_weights: *const f32,
        body_triangles: *const u32,
        body_influences: u32,
        body_triangle_count: u32,
    }
    struct dcloth_fit {
        struct_size: u32,
        warnings: u32,
        scale: f32,
        bone_scale: f32,
        waist_ratio: f32,
        hips_ratio: f32,
        gap_mm: f32,
        penetration_mm: f32,
        penetrating_share: f32,
        stance_degrees: f32,
        stance_role: u32,
        stand_in_role: u32,
        ratios: [f32; DCLOTH_FIT_ROLES],
        joints: [i32; DCLOTH_FIT_ROLES],
        file_bytes: u64,
    }
}

constants! {
    DCLOTH_ALIGNMENT: usize = 64;
    DCLOTH_OK: i32 = 0;
    DCLOTH_ERROR_ARGUMENT: i32 = 1;
    DCLOTH_ERROR_ALIGNMENT: i32 = 2;
    DCLOTH_ERROR_MEMORY: i32 = 3;
    DCLOTH_ERROR_FORMAT: i32 = 4;
    DCLOTH_ERROR_VERSION: i32 = 5;
    DCLOTH_ERROR_SEMANTICS: i32 = 6;
    DCLOTH_ERROR_POSE: i32 = 7;
    DCLOTH_ERROR_JOINTS: i32 = 8;
    DCLOTH_ERROR_MODEL: i32 = 9;
    DCLOTH_STAGES_STATIC: u32 = 1;
    DCLOTH_STAGES_SKELETON: u32 = 3;
    DCLOTH_STAGES_MESH: u32 = 7;
    DCLOTH_AXIS_X: u32 = 0;
    DCLOTH_AXIS_MINUS_X: u32 = 1;
    DCLOTH_AXIS_Y: u32 = 2;
    DCLOTH_AXIS_MINUS_Y: u32 = 3;
    DCLOTH_AXIS_Z: u32 = 4;
    DCLOTH_AXIS_MINUS_Z: u32 = 5;
    DCLOTH_JOINT_FRAMES_CONVERTED: u32 = 0;
    DCLOTH_JOINT_FRAMES_KEPT: u32 = 1;
    DCLOTH_FRAME_PIPELINED: u32 = 1;
    DCLOTH_FRAME_JUMPED: u32 = 2;
    DCLOTH_FRAME_HOLD: u32 = 8;
    DCLOTH_FRAME_FREEZE_IDLE: u32 = 16;
    DCLOTH_OUTPUT_OUTSIDE_BODY: u32 = 1;
    DCLOTH_OUTPUT_COARSE: u32 = 2;
    DCLOTH_OUTPUT_TEXTURED: u32 = 4;
    DCLOTH_JOINT_TOP: i32 = -1;
    DCLOTH_JOINT_UNKNOWN: i32 = -2;
    DCLOTH_RESTORE_OTHER_MODEL: u32 = 1;
    DCLOTH_FIT_ROLES: usize = 32;
    DCLOTH_FIT_STAND_IN: u32 = 1;
    DCLOTH_FIT_PROPORTIONS: u32 = 2;
    DCLOTH_FIT_STANCE: u32 = 4;
    DCLOTH_FIT_GIRTH: u32 = 8;
    DCLOTH_FIT_GAP: u32 = 16;
    DCLOTH_FIT_PENETRATION: u32 = 32;
    DCLOTH_FIT_FACING: u32 = 64;
    DCLOTH_ROLE_NONE: u32 = 0;
    DCLOTH_ROLE_HIPS: u32 = 1;
    DCLOTH_ROLE_SPINE: u32 = 2;
    DCLOTH_ROLE_CHEST: u32 = 3;
    DCLOTH_ROLE_UPPER_CHEST: u32 = 4;
    DCLOTH_ROLE_NECK: u32 = 5;
    DCLOTH_ROLE_HEAD: u32 = 6;
    DCLOTH_ROLE_LEFT_SHOULDER: u32 = 7;
    DCLOTH_ROLE_LEFT_UPPER_ARM: u32 = 8;
    DCLOTH_ROLE_LEFT_LOWER_ARM: u32 = 9;
    DCLOTH_ROLE_LEFT_HAND: u32 = 10;
    DCLOTH_ROLE_RIGHT_SHOULDER: u32 = 11;
    DCLOTH_ROLE_RIGHT_UPPER_ARM: u32 = 12;
    DCLOTH_ROLE_RIGHT_LOWER_ARM: u32 = 13;
    DCLOTH_ROLE_RIGHT_HAND: u32 = 14;
    DCLOTH_ROLE_LEFT_UPPER_LEG: u32 = 15;
    DCLOTH_ROLE_LEFT_LOWER_LEG: u32 = 16;
    DCLOTH_ROLE_LEFT_FOOT: u32 = 17;
    DCLOTH_ROLE_LEFT_TOES: u32 = 18;
    DCLOTH_ROLE_RIGHT_UPPER_LEG: u32 = 19;
    DCLOTH_ROLE_RIGHT_LOWER_LEG: u32 = 20;
    DCLOTH_ROLE_RIGHT_FOOT: u32 = 21;
    DCLOTH_ROLE_RIGHT_TOES: u32 = 22;
}

functions! {
    fn dcloth_version() -> *const c_char;
    fn dcloth_status_name(status: dcloth_status) -> *const c_char;
    fn dcloth_isa_name() -> *const c_char;
    fn dcloth_isa_select(name: *const c_char) -> dcloth_status;
    fn dcloth_model_storage_size() -> usize;
    fn dcloth_model_open(bytes: *const c_void, size: usize, storage: *mut c_void, storage_size: usize,
                         model: *mut *mut dcloth_model, error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_model_describe(model: *const dcloth_model, info: *mut dcloth_model_info) -> dcloth_status;
    fn dcloth_model_joint_name(model: *const dcloth_model, index: u32) -> *const c_char;
    fn dcloth_model_joint_parent(model: *const dcloth_model, index: u32) -> i32;
    fn dcloth_model_joint_bind(model: *const dcloth_model, index: u32, matrix: *mut f32) -> dcloth_status;
    fn dcloth_model_body_vertex_count(model: *const dcloth_model) -> u32;
    fn dcloth_model_reads_wind(model: *const dcloth_model) -> u32;
    fn dcloth_cloth_storage_size(model: *const dcloth_model) -> usize;
    fn dcloth_cloth_create(model: *const dcloth_model, storage: *mut c_void, storage_size: usize,
                           cloth: *mut *mut dcloth_cloth, error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_cloth_bind_joints(cloth: *mut dcloth_cloth, names: *const *const c_char, count: u32,
                                error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_cloth_set_space(cloth: *mut dcloth_cloth, space: *const dcloth_space,
                              error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_cloth_set_bind_pose(cloth: *mut dcloth_cloth, bind: *const dcloth_pose,
                                  error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_cloth_set_fit(cloth: *mut dcloth_cloth, fit: *const c_void, size: usize,
                            error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_cloth_set_wind(cloth: *mut dcloth_cloth, wind: *const f32, error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_cloth_reset(cloth: *mut dcloth_cloth) -> dcloth_status;
    fn dcloth_cloth_state_size(cloth: *const dcloth_cloth) -> usize;
    fn dcloth_cloth_save(cloth: *const dcloth_cloth, state: *mut c_void, size: usize,
                         error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_cloth_restore(cloth: *mut dcloth_cloth, state: *const c_void, size: usize, flags: u32,
                            error: *mut dcloth_error) -> dcloth_status;
    fn dcloth_cloth_update(cloth: *mut dcloth_cloth, pose: *const dcloth_pose, frame: *const dcloth_frame,
                           output: *const dcloth_output, timer: *mut dcloth_timer) -> dcloth_status;
    fn dcloth_cloth_describe(cloth: *const dcloth_cloth, info: *mut dcloth_cloth_info) -> dcloth_status;
    fn dcloth_role_of_name(name: *const c_char) -> u32;
    fn dcloth_role_name(role: u32) -> *const c_char;
    fn dcloth_fit_storage_size(model: *const dcloth_model, character: *const dcloth_character) -> usize;
    fn dcloth_cloth_fit(cloth: *mut dcloth_cloth, character: *const dcloth_character, storage: *mut c_void,
                        storage_size: usize, fit: *mut dcloth_fit, error: *mut dcloth_error) -> dcloth_status;
}

#[cfg(test)]
#[path = "ffi_test.rs"]
mod test;
