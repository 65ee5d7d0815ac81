use bevy::asset::{AssetId, Assets, Handle};
use bevy::ecs::prelude::*;
use bevy::math::Vec3;
use bevy::mesh::{Mesh, VertexAttributeValues};
use bevy::time::Time;
use bevy::transform::components::{GlobalTransform, Transform};
use dcloth::{Cloth, Error, Fit, Frame, Output, Pose, Space, Stages};

use crate::loader::ClothModel;

/// A garment on a character. Give its entity a material; the plugin gives it a mesh, and its vertices in each frame.
///
/// Vertices are in world space: the entity stays at the origin, outside of the character. Despawn it with the
/// character.
#[derive(Component, Clone, Debug)]
#[require(GarmentState, Transform)]
pub struct Garment {
    /// The garment.
    pub model: Handle<ClothModel>,
    /// The character: the entity of its scene, or any entity that has a
    /// [`SkinnedMesh`](bevy::mesh::skinning::SkinnedMesh) or has such below it. The garment waits until one is there.
    pub wearer: Entity,
    /// How joints are found. Read when the garment is dressed.
    pub fit: GarmentFit,
    /// The axes in which the character stands in its bind pose. Read when the garment is dressed.
    pub space: Space,
    /// Pushes vertices out of the body, where the model holds a body.
    pub outside_body: bool,
    /// Spreads the network's work over frames. The motion is then late by less than a thirtieth of a second more.
    pub pipelined: bool,
    /// Fewer stages cost less. They may change from frame to frame.
    pub stages: Stages,
    /// The velocity of the air in the world, in units a second.
    pub wind: Vec3,
    /// Set it in a frame in which the character was moved without motion, such as a portal. The plugin clears it.
    pub jumped: bool,
}

/// How the joints of a garment are found in a skeleton.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GarmentFit {
    /// Lays the garment onto bones and skin of any humanoid character. Parts of the body are found by the joints'
    /// names. The skin takes 0.2 to 0.8 s, once, in the frame in which the garment is dressed.
    #[default]
    Body,
    /// As `Body`, by bones alone, in 50 us. Use it if the skin has other clothes in it.
    Bones,
    /// The skeleton is that of training: the same names, axes and lengths.
    Names,
}

impl Garment {
    /// A garment on any humanoid character, kept outside of its body.
    pub fn new(model: Handle<ClothModel>, wearer: Entity) -> Self {
        Self {
            model,
            wearer,
            fit: GarmentFit::default(),
            space: Space::GLTF,
            outside_body: true,
            pipelined: false,
            stages: Stages::Mesh,
            wind: Vec3::ZERO,
            jumped: false,
        }
    }
}

/// What has become of a [`Garment`]. The plugin adds it.
#[derive(Component, Default, Debug)]
pub struct GarmentState(pub(crate) State);

#[derive(Default, Debug)]
pub(crate) enum State {
    #[default]
    Waiting,
    Dressed(Box<Dressed>),
    Failed(Error, For),
}

/// For which model and character a state was made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct For(pub AssetId<ClothModel>, pub Entity);

impl For {
    pub(crate) fn of(garment: &Garment) -> Self {
        Self(garment.model.id(), garment.wearer)
    }
}

#[derive(Debug)]
pub(crate) struct Dressed {
    pub made_for: For,
    pub cloth: Cloth,
    pub fit: Option<Fit>,
    pub joints: Vec<Entity>,
    pub mesh: Handle<Mesh>,
    pub matrices: Vec<[f32; 16]>,
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub textured: bool, // vertices are those of the model's texture
    pub wind: Vec3,
    pub drawn: bool,            // `positions` and `normals` are new
    pub refused: Option<Error>, // of the last update
}

impl GarmentState {
    /// The engine's cloth, once the garment is dressed: to reset, save and restore it.
    pub fn cloth_mut(&mut self) -> Option<&mut Cloth> {
        match &mut self.0 {
            State::Dressed(dressed) => Some(&mut dressed.cloth),
            _ => None,
        }
    }

    /// Whether the garment is on its character.
    pub fn is_dressed(&self) -> bool {
        matches!(self.0, State::Dressed(_))
    }

    /// How it fits. `None` for [`GarmentFit::Names`].
    pub fn fit(&self) -> Option<&Fit> {
        match &self.0 {
            State::Dressed(dressed) => dressed.fit.as_ref(),
            _ => None,
        }
    }

    /// Joints of the character, in the order of the cloth's poses.
    pub fn joints(&self) -> &[Entity] {
        match &self.0 {
            State::Dressed(dressed) => &dressed.joints,
            _ => &[],
        }
    }

    /// Why the garment could not be put on, or why its last update was refused. The log says it too, once.
    pub fn error(&self) -> Option<&Error> {
        match &self.0 {
            State::Dressed(dressed) => dressed.refused.as_ref(),
            State::Failed(error, _) => Some(error),
            State::Waiting => None,
        }
    }
}

/// Runs the network for every garment. Garments may run on several threads.
pub(crate) fn update(
    time: Res<Time>,
    joints: Query<&GlobalTransform>,
    mut garments: Query<(Entity, &mut Garment, &mut GarmentState)>,
) {
    let seconds = time.delta_secs();
    garments.par_iter_mut().for_each(|(entity, mut garment, mut state)| {
        let State::Dressed(dressed) = &mut state.0 else { return };
        dressed.matrices.clear();
        for joint in &dressed.joints {
            // A joint that is gone went with its character.
            let Ok(global) = joints.get(*joint) else { return };
            dressed.matrices.push(global.to_matrix().to_cols_array());
        }
        match step(dressed, &garment, seconds) {
            Ok(()) => {
                dressed.drawn = true;
                dressed.refused = None;
                if garment.jumped {
                    garment.jumped = false;
                }
            }
            Err(error) => {
                if dressed.refused.is_none() {
                    tracing::error!("garment {entity}: {error}");
                }
                dressed.refused = Some(error);
            }
        }
    });
}

fn step(dressed: &mut Dressed, garment: &Garment, seconds: f32) -> Result<(), Error> {
    if garment.wind != dressed.wind {
        dressed.cloth.set_wind(garment.wind.to_array())?;
        dressed.wind = garment.wind;
    }
    let frame = Frame::new(seconds).stages(garment.stages).pipelined(garment.pipelined).jumped(garment.jumped);
    let output = Output::new(&mut dressed.positions)
        .normals(&mut dressed.normals)
        .outside_body(garment.outside_body)
        .textured(dressed.textured);
    dressed.cloth.update(&Pose::columns(&dressed.matrices), &frame, output)
}

/// Exchanges the new vertices with those in the mesh.
pub(crate) fn show(mut meshes: ResMut<Assets<Mesh>>, mut garments: Query<&mut GarmentState>) {
    for mut state in &mut garments {
        let State::Dressed(dressed) = &mut state.0 else { continue };
        if !std::mem::take(&mut dressed.drawn) {
            continue;
        }
        let Some(mut mesh) = meshes.get_mut(&dressed.mesh) else { continue };
        let Ok(attributes) = mesh.try_attributes_mut() else { continue };
        for (attribute, values) in attributes {
            let VertexAttributeValues::Float32x3(values) = values else { continue };
            if attribute.id == Mesh::ATTRIBUTE_POSITION.id {
                std::mem::swap(values, &mut dressed.positions);
            } else if attribute.id == Mesh::ATTRIBUTE_NORMAL.id {
                std::mem::swap(values, &mut dressed.normals);
            }
        }
    }
}
