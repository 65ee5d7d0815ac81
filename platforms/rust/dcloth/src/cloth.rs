use std::fmt;
use std::ptr::{NonNull, null, null_mut};

use crate::character::{Character, Fit, Names};
use crate::error::{Error, Status, call};
use crate::ffi::*;
use crate::frame::Frame;
use crate::memory::Memory;
use crate::model::Model;
use crate::output::Output;
use crate::pose::{Pose, Space, count};

/// One garment on one character, with its motion. A call that returns an error leaves the cloth as it was.
///
/// Every call that reaches the engine borrows the cloth mutably, because calls on one cloth may not run at the same
/// time. Different cloths may be updated on different threads.
///
/// ```
/// # std::env::set_current_dir(std::env::var("DCLOTH_RUST_DATA")?)?;
/// use dcloth::{Cloth, Frame, Model, Output, Pose};
///
/// let model = Model::read("skirt.dcloth")?;
/// let mut cloth = Cloth::new(&model)?;
/// let (mut positions, mut normals) = (vec![[0.0; 3]; model.vertex_count()], vec![[0.0; 3]; model.vertex_count()]);
///
/// // Your character's joints to world in this frame; here the pose of training.
/// let matrices = (0..model.joint_count()).map(|joint| model.joint_bind(joint)).collect::<Result<Vec<_>, _>>()?;
/// for _frame in 0..10 {
///     let output = Output::new(&mut positions).normals(&mut normals).outside_body(true);
///     cloth.update(&Pose::rows(&matrices), &Frame::new(1.0 / 60.0), output)?;
/// }
/// assert!(positions.iter().flatten().all(|value| value.is_finite()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// The slices of an output stay borrowed until the update, so nothing else can move or free them:
/// ```compile_fail,E0499
/// # fn f(mut cloth: dcloth::Cloth, pose: dcloth::Pose, frame: dcloth::Frame) {
/// let mut positions = vec![[0.0; 3]; 8170];
/// let output = dcloth::Output::new(&mut positions);
/// positions.clear();
/// cloth.update(&pose, &frame, output);
/// # }
/// ```
pub struct Cloth {
    cloth: NonNull<dcloth_cloth>, // in `_memory`
    _memory: Memory,
    fit_memory: Option<Memory>, // that of the last fit, which the cloth reads
    model: Model,               // last: fields are dropped in this order
}

// SAFETY: the engine keeps nothing of a thread; all memory of the cloth moves along.
unsafe impl Send for Cloth {}
// SAFETY: no function of the engine is called with a shared reference.
unsafe impl Sync for Cloth {}

/// What the last update did.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ClothInfo {
    /// A tick has begun and is not complete.
    pub in_work: bool,
    /// How much older the drawn displacement is than the pose.
    pub lag_seconds: f32,
    /// Network work of the last update by estimated cost; 1 is a whole tick of all its stages.
    pub tick_share: f32,
    /// [`Frame::freeze_idle`] has stopped the ticks.
    pub frozen: bool,
    /// The next update with time starts a tick: the first one, or one that was held.
    pub tick_waits: bool,
}

impl Cloth {
    /// A cloth without motion.
    ///
    /// Errors: [`Status::Memory`].
    pub fn new(model: &Model) -> Result<Self, Error> {
        let size = model.cloth_bytes();
        let memory = Memory::new(size)?;
        let mut cloth = null_mut();
        // SAFETY: the model is open; the memory has this size. `Self` keeps both as long as the cloth.
        call(|error| unsafe { dcloth_cloth_create(model.raw(), memory.address(), size, &mut cloth, error) })?;
        let cloth =
            NonNull::new(cloth).ok_or_else(|| Error::plain(Status::Memory, "the engine made no cloth".into()))?;
        Ok(Self { cloth, _memory: memory, fit_memory: None, model: model.clone() })
    }

    /// The garment.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Finds the model's joints by name in the host's skeleton. Poses then have one matrix for each of `names`.
    ///
    /// Errors: [`Status::Joints`] with the joints that are missing, [`Status::Argument`].
    pub fn bind_joints<S: AsRef<str>>(&mut self, names: &[S]) -> Result<(), Error> {
        let count = count("names", names.len())?;
        let names = Names::new(names)?;
        // SAFETY: `count` terminated texts, which the engine does not keep.
        call(|error| unsafe { dcloth_cloth_bind_joints(self.cloth.as_ptr(), names.pointers.as_ptr(), count, error) })
    }

    /// Chooses the host's space for poses, outputs and wind.
    ///
    /// Errors: [`Status::Argument`] for axes that are no space, and for a fitted cloth.
    pub fn set_space(&mut self, space: &Space) -> Result<(), Error> {
        let space = space.raw();
        // SAFETY: the struct has its size.
        call(|error| unsafe { dcloth_cloth_set_space(self.cloth.as_ptr(), &space, error) })
    }

    /// Takes the bind pose of a rig whose joints have axes or a scale of their own. The character stands in the stance,
    /// and at the place, of the figure of training. For other characters use [`Cloth::fit`].
    ///
    /// Errors: [`Status::Pose`], [`Status::Argument`].
    pub fn set_bind_pose(&mut self, bind: &Pose) -> Result<(), Error> {
        let bind = bind.raw()?;
        // SAFETY: the pose's pointer has so many matrices, which the engine does not keep.
        call(|error| unsafe { dcloth_cloth_set_bind_pose(self.cloth.as_ptr(), &bind, error) })
    }

    /// Sets the velocity of the air relative to the ground, in the host's units a second along its axes, at most 100
    /// m/s. Models that do not read the air ignore it ([`Model::reads_wind`]).
    ///
    /// Errors: [`Status::Argument`].
    pub fn set_wind(&mut self, wind: [f32; 3]) -> Result<(), Error> {
        // SAFETY: three numbers.
        call(|error| unsafe { dcloth_cloth_set_wind(self.cloth.as_ptr(), wind.as_ptr(), error) })
    }

    /// Fits the garment to a character that it was not trained on. Poses then have one matrix for each joint of the
    /// character. Set the space before. A fitted cloth refuses [`Cloth::set_bind_pose`] and [`Cloth::set_space`]; it may
    /// be fitted again.
    ///
    /// ```
    /// # std::env::set_current_dir(std::env::var("DCLOTH_RUST_DATA")?)?;
    /// use dcloth::{Character, Cloth, Model, Pose, Role};
    ///
    /// let model = Model::read("skirt.dcloth")?;
    /// let mut cloth = Cloth::new(&model)?;
    /// // Here the figure of training plays the character.
    /// let names: Vec<String> = model.joint_names().map(|name| format!("mixamorig:{name}")).collect();
    /// let names: Vec<&str> = names.iter().map(String::as_str).collect();
    /// let bind = (0..model.joint_count()).map(|joint| model.joint_bind(joint)).collect::<Result<Vec<_>, _>>()?;
    /// let character = Character { joint_names: &names, joint_roles: &[], bind: Pose::rows(&bind), body: None };
    ///
    /// let fit = cloth.fit(&character)?;
    /// assert!((fit.scale - 1.0).abs() < 0.01);
    /// assert_eq!(names[fit.joint(Role::Hips).unwrap()], "mixamorig:Hips");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// Errors: [`Status::Joints`] if the skeleton lacks parts that the garment needs, [`Status::Pose`] for a bind pose
    /// that is no standing T or A pose, [`Status::Argument`], [`Status::Memory`].
    pub fn fit(&mut self, character: &Character) -> Result<Fit, Error> {
        character.with_raw(|raw| {
            // SAFETY: both are whole structs; only counts are read.
            let size = unsafe { dcloth_fit_storage_size(self.model.raw(), raw) };
            let memory = Memory::new(size)?;
            let mut fit = dcloth_fit::new();
            // SAFETY: slices of the counts in `raw`, which the engine does not keep. The memory has this size.
            call(|error| unsafe {
                dcloth_cloth_fit(self.cloth.as_ptr(), raw, memory.address(), size, &mut fit, error)
            })?;
            self.fit_memory = Some(memory); // only now may that of the fit before go
            Ok(Fit::of(&fit))
        })
    }

    /// Lays the garment onto another character, by the bytes of a file of `dcloth dress HERO -o HERO.dcloth-fit`. Poses
    /// then have one matrix for each joint of that character, in its own order; [`Cloth::bind_joints`] after it chooses
    /// others. Set the space before.
    ///
    /// Errors: [`Status::Model`] for the fit of another garment, [`Status::Format`], [`Status::Version`],
    /// [`Status::Semantics`], [`Status::Memory`].
    pub fn set_fit(&mut self, fit: &[u8]) -> Result<(), Error> {
        let memory = Memory::copy_of(fit)?;
        // SAFETY: so many bytes, which live as long as the cloth or its next fit.
        call(|error| unsafe { dcloth_cloth_set_fit(self.cloth.as_ptr(), memory.address(), fit.len(), error) })?;
        self.fit_memory = Some(memory);
        Ok(())
    }

    /// Forgets all motion. Call it after a cut or a spawn. Joints, space, bind pose, wind and fit stay.
    pub fn reset(&mut self) {
        // SAFETY: the cloth is open. With it, the call has nothing to refuse.
        unsafe { dcloth_cloth_reset(self.cloth.as_ptr()) };
    }

    /// Saves all that later frames depend on. Joints, space, bind pose, wind and fit are not saved.
    ///
    /// Errors: [`Status::Semantics`] where NaN weights of the model have spoiled the state.
    pub fn save(&mut self) -> Result<Vec<u8>, Error> {
        // SAFETY: the cloth is open.
        let size = unsafe { dcloth_cloth_state_size(self.cloth.as_ptr()) };
        let mut state = vec![0; size];
        // SAFETY: the memory has this size.
        call(|error| unsafe { dcloth_cloth_save(self.cloth.as_ptr(), state.as_mut_ptr().cast(), size, error) })?;
        Ok(state)
    }

    /// Restores a saved state. The cloth then goes on bit for bit as the saved one would have. The bytes may come from
    /// anywhere: truncated and changed ones are refused.
    ///
    /// Errors: [`Status::Format`], [`Status::Version`], [`Status::Model`], [`Status::Semantics`].
    pub fn restore(&mut self, state: &[u8]) -> Result<(), Error> {
        self.restore_with(state, 0)
    }

    /// As [`Cloth::restore`], for a state of the same network in another precision.
    pub fn restore_other_model(&mut self, state: &[u8]) -> Result<(), Error> {
        self.restore_with(state, DCLOTH_RESTORE_OTHER_MODEL)
    }

    fn restore_with(&mut self, state: &[u8], flags: u32) -> Result<(), Error> {
        // SAFETY: the slice has this size.
        call(|error| unsafe {
            dcloth_cloth_restore(self.cloth.as_ptr(), state.as_ptr().cast(), state.len(), flags, error)
        })
    }

    /// Runs the ticks that are due and draws. Call it once per frame, at any frame rate.
    ///
    /// Errors: [`Status::Pose`] for NaN, infinity or a wrong number of joints, [`Status::Argument`] for a time or
    /// slices that do not fit. State and slices are then untouched.
    pub fn update(&mut self, pose: &Pose, frame: &Frame, output: Output) -> Result<(), Error> {
        let mut output = output;
        let raw = output.raw(&self.model)?;
        self.run(pose, frame, &raw)
    }

    /// As [`Cloth::update`], for a garment that is not seen: motion goes on, nothing is drawn.
    pub fn update_unseen(&mut self, pose: &Pose, frame: &Frame) -> Result<(), Error> {
        self.run(pose, frame, null())
    }

    /// `output`: null, or what `Output::raw` returned for an output that still lives.
    fn run(&mut self, pose: &Pose, frame: &Frame, output: *const dcloth_output) -> Result<(), Error> {
        let pose = pose.raw()?;
        call(|error| {
            let frame = dcloth_frame {
                stages: frame.stages.number(),
                seconds: frame.seconds,
                flags: frame.flags,
                error,
                ..dcloth_frame::new()
            };
            // SAFETY: all structs have their sizes. The slices behind them have the lengths that the structs say.
            unsafe { dcloth_cloth_update(self.cloth.as_ptr(), &pose, &frame, output, null_mut()) }
        })
    }

    /// What the last update did.
    pub fn describe(&mut self) -> ClothInfo {
        let mut info = dcloth_cloth_info::new();
        // SAFETY: the struct has its size. With it, the call has nothing to refuse.
        unsafe { dcloth_cloth_describe(self.cloth.as_ptr(), &mut info) };
        ClothInfo {
            in_work: info.in_work != 0,
            lag_seconds: info.lag_seconds,
            tick_share: info.tick_share,
            frozen: info.frozen != 0,
            tick_waits: info.tick_waits != 0,
        }
    }
}

impl fmt::Debug for Cloth {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Cloth")
            .field("model", &self.model)
            .field("fit_memory", &self.fit_memory.is_some())
            .finish_non_exhaustive()
    }
}
