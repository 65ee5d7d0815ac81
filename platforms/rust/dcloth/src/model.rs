use std::fmt;
use std::path::Path;
use std::ptr::{NonNull, null_mut};
use std::slice;
use std::sync::Arc;

use crate::error::{Error, Status, call, text_at};
use crate::ffi::*;
use crate::memory::Memory;

/// Which stages of the network run. Each stage needs the ones before it, so fewer stages are a level of detail.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Stages {
    /// The stage without memory.
    Static,
    /// The static stage and the one that remembers the motion of the skeleton.
    Skeleton,
    /// All stages.
    #[default]
    Mesh,
}

impl Stages {
    pub(crate) fn number(self) -> u32 {
        match self {
            Self::Static => DCLOTH_STAGES_STATIC,
            Self::Skeleton => DCLOTH_STAGES_SKELETON,
            Self::Mesh => DCLOTH_STAGES_MESH,
        }
    }
}

/// The joint above a joint of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Parent {
    /// The index of the nearest joint above that the model has.
    Joint(usize),
    /// There is no joint above.
    Top,
    /// The file does not say.
    Unknown,
}

/// A trained garment. A clone shares the bytes, and each [`Cloth`](crate::Cloth) keeps one, so a model lives as long as
/// it is needed.
///
/// ```
/// # std::env::set_current_dir(std::env::var("DCLOTH_RUST_DATA")?)?;
/// use dcloth::Model;
///
/// let model = Model::read("skirt.dcloth")?;
/// assert_eq!(model.name(), "skirt");
/// assert!(model.joint_names().any(|name| name == "Hips"));
/// assert_eq!(model.positions().len(), model.vertex_count());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Model(Arc<Open>);

struct Open {
    model: NonNull<dcloth_model>, // in `_view`
    info: dcloth_model_info,      // its pointers lead into `_bytes`
    _view: Memory,
    _bytes: Memory,
}

// SAFETY: after opening, bytes and view are only read, and the engine may read them on many threads.
unsafe impl Send for Open {}
// SAFETY: as above.
unsafe impl Sync for Open {}

/// The mesh that a texture is drawn on: the garment's vertices, then those that repeat a vertex at a seam.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Texture<'a> {
    /// u to the right and v down from the upper left, as in glTF, of each vertex.
    pub coordinates: &'a [[f32; 2]],
    /// The garment's triangles by these vertices.
    pub triangles: &'a [[u16; 3]],
    /// The garment's vertex that each of the others repeats.
    pub seam_vertices: &'a [u16],
}

impl Model {
    /// Checks the bytes of a `.dcloth` file and opens them. The bytes are copied and need no alignment. They may come
    /// from anywhere: every build checks all that playing relies on.
    ///
    /// Errors: [`Status::Format`], [`Status::Version`], [`Status::Semantics`], [`Status::Memory`].
    pub fn open(bytes: &[u8]) -> Result<Self, Error> {
        let copy = Memory::copy_of(bytes)?;
        // SAFETY: no arguments.
        let view_size = unsafe { dcloth_model_storage_size() };
        let view = Memory::new(view_size)?;
        let mut model = null_mut();
        // SAFETY: both memories are aligned, have these sizes and live as long as the model, in `Open`.
        call(|error| unsafe {
            dcloth_model_open(copy.address(), bytes.len(), view.address(), view_size, &mut model, error)
        })?;
        let model =
            NonNull::new(model).ok_or_else(|| Error::plain(Status::Format, "the engine opened no model".into()))?;
        let mut info = dcloth_model_info::new();
        // SAFETY: the model is open, and the struct has its size.
        call(|_| unsafe { dcloth_model_describe(model.as_ptr(), &mut info) })?;
        Ok(Self(Arc::new(Open { model, info, _view: view, _bytes: copy })))
    }

    /// Reads a file and opens it.
    ///
    /// Errors: as [`Model::open`], and [`Status::Io`] for a file that cannot be read.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let bytes =
            std::fs::read(path).map_err(|error| Error::plain(Status::Io, format!("{}: {error}", path.display())))?;
        Self::open(&bytes)
    }

    pub(crate) fn raw(&self) -> *const dcloth_model {
        self.0.model.as_ptr()
    }

    /// The garment's name.
    pub fn name(&self) -> String {
        // SAFETY: terminated text in the model's bytes.
        unsafe { text_at(self.0.info.name) }.unwrap_or_default()
    }

    /// `"fp32"`, `"fp16"`, `"int8"`, or what the converter was asked for.
    pub fn precision(&self) -> String {
        // SAFETY: terminated text in the model's bytes.
        unsafe { text_at(self.0.info.precision) }.unwrap_or_default()
    }

    /// Joints of the model: so many matrices has a pose, unless joints were bound or the cloth was fitted.
    pub fn joint_count(&self) -> usize {
        self.0.info.joint_count as usize
    }

    /// Vertices of the garment.
    pub fn vertex_count(&self) -> usize {
        self.0.info.vertex_count as usize
    }

    /// The highest stages that the model holds.
    pub fn stages(&self) -> Stages {
        match self.0.info.stages {
            stages if stages & DCLOTH_STAGES_MESH == DCLOTH_STAGES_MESH => Stages::Mesh,
            stages if stages & DCLOTH_STAGES_SKELETON == DCLOTH_STAGES_SKELETON => Stages::Skeleton,
            _ => Stages::Static,
        }
    }

    /// The network's time step.
    pub fn tick_seconds(&self) -> f32 {
        self.0.info.tick_seconds
    }

    /// The file's version: major, minor.
    pub fn format(&self) -> (u32, u32) {
        (self.0.info.format_major, self.0.info.format_minor)
    }

    /// Corners of each triangle, counter-clockwise seen from outside.
    pub fn triangles(&self) -> &[[u16; 3]] {
        let info = &self.0.info;
        // SAFETY: the engine has checked that the bytes hold so many, and they live as long as the model.
        unsafe { numbers(info.triangles.cast(), info.triangle_count) }
    }

    /// The garment in the bind pose of training, in metres and the default axes.
    pub fn positions(&self) -> &[[f32; 3]] {
        let info = &self.0.info;
        // SAFETY: as above.
        unsafe { numbers(info.positions.cast(), info.vertex_count) }
    }

    /// Where the garment lies in a texture; none where the model holds no texture coordinates.
    pub fn texture(&self) -> Option<Texture<'_>> {
        let info = &self.0.info;
        if info.textured_vertex_count == 0 {
            return None;
        }
        // SAFETY: as above.
        unsafe {
            Some(Texture {
                coordinates: numbers(info.texture_coordinates.cast(), info.textured_vertex_count),
                triangles: numbers(info.textured_triangles.cast(), info.triangle_count),
                seam_vertices: match info.seam_vertex_count {
                    0 => &[],
                    count => numbers(info.seam_vertices, count),
                },
            })
        }
    }

    /// Names of the model's joints, in the order of its poses.
    pub fn joint_names(&self) -> impl ExactSizeIterator<Item = String> + '_ {
        (0..self.0.info.joint_count)
            // SAFETY: the model is open; the name is a terminated text in its bytes.
            .map(|joint| unsafe { text_at(dcloth_model_joint_name(self.raw(), joint)) }.unwrap_or_default())
    }

    /// The joint above a joint. `Unknown` past the last joint.
    pub fn joint_parent(&self, joint: usize) -> Parent {
        let joint = u32::try_from(joint).unwrap_or(u32::MAX);
        // SAFETY: the model is open; any index may be asked for.
        match unsafe { dcloth_model_joint_parent(self.raw(), joint) } {
            DCLOTH_JOINT_TOP => Parent::Top,
            DCLOTH_JOINT_UNKNOWN => Parent::Unknown,
            parent => usize::try_from(parent).map_or(Parent::Unknown, Parent::Joint),
        }
    }

    /// A joint's matrix in the bind pose of training, joint to world: 16 numbers, row after row, in metres and the
    /// default axes.
    ///
    /// Errors: [`Status::Argument`] past the last joint, [`Status::Semantics`] where the matrix has no inverse.
    pub fn joint_bind(&self, joint: usize) -> Result<[f32; 16], Error> {
        if joint >= self.joint_count() {
            return Err(Error::argument("joint", joint, format_args!("less than {}", self.joint_count())));
        }
        let mut matrix = [0.0; 16];
        // SAFETY: the model is open, and the array has room for 16 numbers.
        call(|_| unsafe { dcloth_model_joint_bind(self.raw(), joint as u32, matrix.as_mut_ptr()) })?;
        Ok(matrix)
    }

    /// Vertices of the skin that [`Output::outside_body`](crate::Output::outside_body) keeps the cloth out of; 0
    /// without.
    pub fn body_vertex_count(&self) -> usize {
        // SAFETY: the model is open.
        unsafe { dcloth_model_body_vertex_count(self.raw()) as usize }
    }

    /// Whether [`Cloth::set_wind`](crate::Cloth::set_wind) changes the motion of this garment.
    pub fn reads_wind(&self) -> bool {
        // SAFETY: the model is open.
        unsafe { dcloth_model_reads_wind(self.raw()) != 0 }
    }

    /// Bytes that each cloth of this model takes.
    pub fn cloth_bytes(&self) -> usize {
        // SAFETY: the model is open.
        unsafe { dcloth_cloth_storage_size(self.raw()) }
    }
}

impl fmt::Debug for Model {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("Model")
            .field("name", &self.name())
            .field("precision", &self.precision())
            .field("vertex_count", &self.vertex_count())
            .finish_non_exhaustive()
    }
}

/// # Safety
/// `first` is null, or `count` of `T` lie there and outlive `'a` unchanged.
unsafe fn numbers<'a, T>(first: *const T, count: u32) -> &'a [T] {
    if first.is_null() || count == 0 {
        return &[];
    }
    // SAFETY: by the caller.
    unsafe { slice::from_raw_parts(first, count as usize) }
}
