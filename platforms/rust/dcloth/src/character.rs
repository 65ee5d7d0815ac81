use std::ffi::{CStr, CString, c_char};
use std::ptr::null;

use crate::error::Error;
use crate::ffi::*;
use crate::pose::{Pose, count};

/// Declares the roles in the order of the engine's numbers.
macro_rules! roles {
    ($($role:ident = $number:ident,)*) => {
        /// Which part of the body a joint moves.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[non_exhaustive]
        #[allow(missing_docs)]
        pub enum Role {
            $($role,)*
        }

        impl Role {
            /// All roles.
            pub const ALL: &'static [Self] = &[$(Self::$role,)*];

            pub(crate) fn number(self) -> u32 {
                match self {
                    $(Self::$role => $number,)*
                }
            }

            fn of_number(number: u32) -> Option<Self> {
                match number {
                    $($number => Some(Self::$role),)*
                    _ => None,
                }
            }
        }
    };
}

roles! {
    Hips = DCLOTH_ROLE_HIPS,
    Spine = DCLOTH_ROLE_SPINE,
    Chest = DCLOTH_ROLE_CHEST,
    UpperChest = DCLOTH_ROLE_UPPER_CHEST,
    Neck = DCLOTH_ROLE_NECK,
    Head = DCLOTH_ROLE_HEAD,
    LeftShoulder = DCLOTH_ROLE_LEFT_SHOULDER,
    LeftUpperArm = DCLOTH_ROLE_LEFT_UPPER_ARM,
    LeftLowerArm = DCLOTH_ROLE_LEFT_LOWER_ARM,
    LeftHand = DCLOTH_ROLE_LEFT_HAND,
    RightShoulder = DCLOTH_ROLE_RIGHT_SHOULDER,
    RightUpperArm = DCLOTH_ROLE_RIGHT_UPPER_ARM,
    RightLowerArm = DCLOTH_ROLE_RIGHT_LOWER_ARM,
    RightHand = DCLOTH_ROLE_RIGHT_HAND,
    LeftUpperLeg = DCLOTH_ROLE_LEFT_UPPER_LEG,
    LeftLowerLeg = DCLOTH_ROLE_LEFT_LOWER_LEG,
    LeftFoot = DCLOTH_ROLE_LEFT_FOOT,
    LeftToes = DCLOTH_ROLE_LEFT_TOES,
    RightUpperLeg = DCLOTH_ROLE_RIGHT_UPPER_LEG,
    RightLowerLeg = DCLOTH_ROLE_RIGHT_LOWER_LEG,
    RightFoot = DCLOTH_ROLE_RIGHT_FOOT,
    RightToes = DCLOTH_ROLE_RIGHT_TOES,
}

impl Role {
    /// The role of a joint with this name. The names of Mixamo, Unity Humanoid, the Unreal mannequin, MakeHuman,
    /// Rigify, VRM, CMU, 3ds Max Biped and Character Creator are known, with any prefix, case and separators.
    ///
    /// ```
    /// use dcloth::Role;
    /// assert_eq!(Role::of_name("mixamorig:LeftUpLeg"), Some(Role::LeftUpperLeg));
    /// assert_eq!(Role::of_name("sword"), None);
    /// ```
    pub fn of_name(name: &str) -> Option<Self> {
        let name = CString::new(name).ok()?;
        // SAFETY: a terminated text.
        Self::of_number(unsafe { dcloth_role_of_name(name.as_ptr()) })
    }

    /// The role in words, such as `"left upper leg"`.
    pub fn name(self) -> &'static str {
        // SAFETY: any number may be asked for.
        let text = unsafe { dcloth_role_name(self.number()) };
        if text.is_null() {
            return "";
        }
        // SAFETY: terminated and static text.
        unsafe { CStr::from_ptr(text) }.to_str().unwrap_or_default()
    }
}

/// A character in its bind pose: the standing T or A pose in which its skin was bound to its joints. Matrices and
/// points are in the host's space and in one world.
#[derive(Clone, Copy, Debug)]
pub struct Character<'a> {
    /// Names of the whole skeleton's joints, 1 to 4096. Poses have one matrix for each, in this order.
    pub joint_names: &'a [&'a str],
    /// The role of each joint, `None` where its name tells. Empty: all by name.
    pub joint_roles: &'a [Option<Role>],
    /// The bind pose: any axes and scale of a joint's own.
    pub bind: Pose<'a>,
    /// The skin. With it, the cut of the garment and the surface that keeps it outside are moved onto that skin. This
    /// takes 0.2 to 0.8 s; without it a fit takes 50 us.
    pub body: Option<Body<'a>>,
}

/// The skin of a character.
#[derive(Clone, Copy, Debug)]
pub struct Body<'a> {
    /// Points in the bind pose, in the world.
    pub positions: &'a [[f32; 3]],
    /// Indices of joints, the same number for each point: 1 to 16, point after point.
    pub joints: &'a [u32],
    /// The weight of each, 0 or more.
    pub weights: &'a [f32],
    /// Corners of each triangle. Empty: the points must lie close to each other.
    pub triangles: &'a [[u32; 3]],
}

impl Character<'_> {
    /// Calls with the description that the engine reads.
    pub(crate) fn with_raw<R>(&self, use_it: impl FnOnce(&dcloth_character) -> Result<R, Error>) -> Result<R, Error> {
        let joints = self.joint_names.len();
        let same = |what: &str, found: usize| {
            let allowed = format_args!("{joints}, one for each joint name");
            if found == joints { Ok(()) } else { Err(Error::argument(what, found, allowed)) }
        };
        same("bind matrices", self.bind.matrices.len())?;
        if !self.joint_roles.is_empty() {
            same("joint_roles", self.joint_roles.len())?;
        }
        let names = Names::new(self.joint_names)?;
        let roles: Vec<u32> = self.joint_roles.iter().map(|role| role.map_or(DCLOTH_ROLE_NONE, Role::number)).collect();
        let mut raw = dcloth_character {
            joint_count: count("joint_names", joints)?,
            joint_names: names.pointers.as_ptr(),
            joint_roles: if roles.is_empty() { null() } else { roles.as_ptr() },
            bind_matrices: self.bind.matrices.as_ptr().cast(),
            column_major: self.bind.column_major.into(),
            ..dcloth_character::new()
        };
        if let Some(body) = self.body.filter(|body| !body.positions.is_empty()) {
            let points = body.positions.len();
            if body.joints.len() % points != 0 || body.weights.len() != body.joints.len() {
                return Err(Error::argument(
                    "body",
                    format_args!("{} joints and {} weights", body.joints.len(), body.weights.len()),
                    format_args!("the same number of both, a multiple of the {points} positions"),
                ));
            }
            raw.body_vertex_count = count("body.positions", points)?;
            raw.body_positions = body.positions.as_ptr().cast();
            raw.body_joints = body.joints.as_ptr();
            raw.body_weights = body.weights.as_ptr();
            raw.body_influences = count("body.joints", body.joints.len() / points)?;
            raw.body_triangle_count = count("body.triangles", body.triangles.len())?;
            raw.body_triangles = if body.triangles.is_empty() { null() } else { body.triangles.as_ptr().cast() };
        }
        use_it(&raw)
    }
}

/// Terminated names, and where each starts.
pub(crate) struct Names {
    pub(crate) pointers: Vec<*const c_char>,
    _texts: Vec<CString>,
}

impl Names {
    pub(crate) fn new<S: AsRef<str>>(names: &[S]) -> Result<Self, Error> {
        let texts = names
            .iter()
            .map(|name| {
                CString::new(name.as_ref())
                    .map_err(|_| Error::argument("joint name", format_args!("{:?}", name.as_ref()), "no zero byte"))
            })
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Self { pointers: texts.iter().map(|text| text.as_ptr()).collect(), _texts: texts })
    }
}

/// Why a fit may not look right.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum FitWarning {
    /// A joint of the garment is not in the skeleton. The next one of the body moves its part.
    StandIn,
    /// A bone is much shorter or longer than the scaled figure's.
    Proportions,
    /// A limb stands far from the figure's: over 60 degrees (arm) or 25 (leg).
    Stance,
    /// Waist or hips have another girth than the scaled figure's.
    Girth,
    /// The closest parts are over 15 mm further from the skin than on the figure.
    Gap,
    /// Skin stands more than 5 mm out of the garment somewhere.
    Penetration,
    /// There are no toes and no skin of the feet: a swap of left and right would not be noticed.
    Facing,
}

/// How a garment fits. Lengths are real metres or millimetres of the character.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Fit {
    /// Why the fit may not look right.
    pub warnings: Vec<FitWarning>,
    /// The garment is drawn this many times the size it was trained at.
    pub scale: f32,
    /// By bones alone: legs and trunk over the figure's.
    pub bone_scale: f32,
    /// Radius of the waist over that of the figure at `bone_scale`; 0 without a body.
    pub waist_ratio: f32,
    /// The same of the hips.
    pub hips_ratio: f32,
    /// Mean distance to the skin at rest of the parts closest to it; 0 without a body.
    pub gap_mm: f32,
    /// How far skin stands out of the garment at rest at the worst vertex; 0 without a body.
    pub penetration_mm: f32,
    /// Of vertices near the skin, the share with skin more than 1 mm outside of them.
    pub penetrating_share: f32,
    /// Largest turn of a limb between the figure's bind pose and the character's.
    pub stance_degrees: f32,
    /// That limb.
    pub stance_role: Option<Role>,
    /// The first role without a joint of its own, where [`FitWarning::StandIn`] is set.
    pub stand_in_role: Option<Role>,
    ratios: [f32; DCLOTH_FIT_ROLES],
    joints: [i32; DCLOTH_FIT_ROLES],
}

impl Fit {
    pub(crate) fn of(raw: &dcloth_fit) -> Self {
        const WARNINGS: [(u32, FitWarning); 7] = [
            (DCLOTH_FIT_STAND_IN, FitWarning::StandIn),
            (DCLOTH_FIT_PROPORTIONS, FitWarning::Proportions),
            (DCLOTH_FIT_STANCE, FitWarning::Stance),
            (DCLOTH_FIT_GIRTH, FitWarning::Girth),
            (DCLOTH_FIT_GAP, FitWarning::Gap),
            (DCLOTH_FIT_PENETRATION, FitWarning::Penetration),
            (DCLOTH_FIT_FACING, FitWarning::Facing),
        ];
        Self {
            warnings: WARNINGS.iter().filter(|(bit, _)| raw.warnings & bit != 0).map(|(_, warning)| *warning).collect(),
            scale: raw.scale,
            bone_scale: raw.bone_scale,
            waist_ratio: raw.waist_ratio,
            hips_ratio: raw.hips_ratio,
            gap_mm: raw.gap_mm,
            penetration_mm: raw.penetration_mm,
            penetrating_share: raw.penetrating_share,
            stance_degrees: raw.stance_degrees,
            stance_role: Role::of_number(raw.stance_role),
            stand_in_role: Role::of_number(raw.stand_in_role),
            ratios: raw.ratios,
            joints: raw.joints,
        }
    }

    /// The bone from the role's joint to the next, over the scaled figure's.
    pub fn ratio(&self, role: Role) -> Option<f32> {
        self.ratios.get(role.number() as usize).copied().filter(|ratio| *ratio > 0.0)
    }

    /// The index of the joint that was taken for a role.
    pub fn joint(&self, role: Role) -> Option<usize> {
        self.joints.get(role.number() as usize).and_then(|joint| usize::try_from(*joint).ok())
    }
}
