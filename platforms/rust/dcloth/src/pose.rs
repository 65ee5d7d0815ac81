use crate::error::Error;
use crate::ffi::*;

/// A direction along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[allow(missing_docs)]
pub enum Axis {
    X,
    MinusX,
    Y,
    MinusY,
    Z,
    MinusZ,
}

impl Axis {
    fn number(self) -> u32 {
        match self {
            Self::X => DCLOTH_AXIS_X,
            Self::MinusX => DCLOTH_AXIS_MINUS_X,
            Self::Y => DCLOTH_AXIS_Y,
            Self::MinusY => DCLOTH_AXIS_MINUS_Y,
            Self::Z => DCLOTH_AXIS_Z,
            Self::MinusZ => DCLOTH_AXIS_MINUS_Z,
        }
    }
}

/// The host's axes and unit, as the character stands in its bind pose.
///
/// "World" may be any frame that stays upright: the scene, a vehicle, the character's own root. The cloth does not
/// notice how that frame itself moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Space {
    /// Where the character's left points. All three axes differ.
    pub left: Axis,
    /// Where up is.
    pub up: Axis,
    /// Where the character looks. The three decide whether the space is left- or right-handed.
    pub forward: Axis,
    /// The host's unit: 0.0001 to 1000.
    pub metres_per_unit: f32,
    /// Whether the joints keep the axes of training, and only the world was converted.
    pub joint_frames_kept: bool,
}

impl Space {
    /// glTF and Godot, and what a cloth has until another space is set.
    pub const GLTF: Self = Self::new(Axis::X, Axis::Y, Axis::Z, 1.0);
    /// A character that looks along -Z, as Bevy's cameras do.
    pub const FORWARD_MINUS_Z: Self = Self::new(Axis::MinusX, Axis::Y, Axis::MinusZ, 1.0);
    /// Unity.
    pub const UNITY: Self = Self::new(Axis::MinusX, Axis::Y, Axis::Z, 1.0);
    /// An actor in Unreal.
    pub const UNREAL: Self = Self::new(Axis::MinusY, Axis::Z, Axis::X, 0.01);
    /// Blender.
    pub const BLENDER: Self = Self::new(Axis::X, Axis::Z, Axis::MinusY, 1.0);

    /// A space whose joints were converted together with the world, as in most engines.
    pub const fn new(left: Axis, up: Axis, forward: Axis, metres_per_unit: f32) -> Self {
        Self { left, up, forward, metres_per_unit, joint_frames_kept: false }
    }

    pub(crate) fn raw(&self) -> dcloth_space {
        dcloth_space {
            left: self.left.number(),
            up: self.up.number(),
            forward: self.forward.number(),
            metres_per_unit: self.metres_per_unit,
            joint_frames: if self.joint_frames_kept { DCLOTH_JOINT_FRAMES_KEPT } else { DCLOTH_JOINT_FRAMES_CONVERTED },
            ..dcloth_space::new()
        }
    }
}

impl Default for Space {
    fn default() -> Self {
        Self::GLTF
    }
}

/// One matrix for each joint: joint to world, without scale, in the host's space. Matrices act on column vectors.
///
/// Matrix j belongs to joint j of the model. After [`Cloth::bind_joints`](crate::Cloth::bind_joints) or
/// [`Cloth::fit`](crate::Cloth::fit) it belongs to joint j of the host.
#[derive(Clone, Copy, Debug)]
pub struct Pose<'a> {
    pub(crate) matrices: &'a [[f32; 16]],
    pub(crate) column_major: bool,
}

impl<'a> Pose<'a> {
    /// Matrices whose columns follow each other, as in glTF, glam and Bevy (`Mat4::to_cols_array`).
    pub fn columns(matrices: &'a [[f32; 16]]) -> Self {
        Self { matrices, column_major: true }
    }

    /// Matrices whose rows follow each other.
    pub fn rows(matrices: &'a [[f32; 16]]) -> Self {
        Self { matrices, column_major: false }
    }

    pub(crate) fn raw(&self) -> Result<dcloth_pose, Error> {
        Ok(dcloth_pose {
            joint_count: count("joint_matrices", self.matrices.len())?,
            joint_matrices: self.matrices.as_ptr().cast(),
            column_major: self.column_major.into(),
            ..dcloth_pose::new()
        })
    }
}

/// A length as the engine takes it.
pub(crate) fn count(what: &str, length: usize) -> Result<u32, Error> {
    u32::try_from(length).map_err(|_| Error::argument(what, length, "less than 2^32"))
}
