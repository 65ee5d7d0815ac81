//! Puts garments onto characters: reads skeleton, bind pose and skin, and fits the cloth.
use bevy::asset::{Assets, RenderAssetUsages};
use bevy::ecs::prelude::*;
use bevy::ecs::system::SystemParam;
use bevy::math::{Mat4, Quat, Vec3};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Indices, Mesh, Mesh3d, PrimitiveTopology, VertexAttributeValues};
use bevy::platform::collections::HashMap;
use bevy::transform::components::{GlobalTransform, Transform};
use dcloth::{Body, Character, Cloth, Error, Fit, Model, Pose};

use crate::garment::{Dressed, For, Garment, GarmentFit, GarmentState, State};
use crate::loader::ClothModel;

/// What is known of characters.
#[derive(SystemParam)]
pub(crate) struct Characters<'w, 's> {
    binds: Res<'w, Assets<SkinnedMeshInverseBindposes>>,
    skins: Query<'w, 's, (&'static SkinnedMesh, &'static Mesh3d)>,
    children: Query<'w, 's, &'static Children>,
    parents: Query<'w, 's, &'static ChildOf>,
    names: Query<'w, 's, &'static Name>,
    locals: Query<'w, 's, &'static Transform>,
    globals: Query<'w, 's, &'static GlobalTransform>,
}

pub(crate) fn dress(
    mut commands: Commands,
    models: Res<Assets<ClothModel>>,
    mut meshes: ResMut<Assets<Mesh>>,
    characters: Characters,
    mut garments: Query<(Entity, &Garment, &mut GarmentState)>,
) {
    for (entity, garment, mut state) in &mut garments {
        let wanted = For::of(garment);
        match &state.0 {
            State::Dressed(dressed) if dressed.made_for == wanted => continue,
            State::Failed(_, made_for) if *made_for == wanted => continue,
            _ => {}
        }
        let Some(model) = models.get(&garment.model) else { continue };
        let Some(figure) = characters.figure(garment, &meshes) else { continue };
        match put_on(&model.0, garment, &figure) {
            Ok((cloth, fit)) => {
                if let Some(fit) = fit.as_ref().filter(|fit| !fit.warnings.is_empty()) {
                    tracing::warn!("garment {entity}: it may not look right: {:?}", fit.warnings);
                }
                let mesh = meshes.add(mesh_of(&model.0));
                commands.entity(entity).insert(Mesh3d(mesh.clone()));
                let vertices = model.0.texture().map_or(model.0.vertex_count(), |texture| texture.coordinates.len());
                state.0 = State::Dressed(Box::new(Dressed {
                    made_for: wanted,
                    cloth,
                    fit,
                    matrices: Vec::with_capacity(figure.joints.len()),
                    joints: figure.joints,
                    mesh,
                    positions: vec![[0.0; 3]; vertices],
                    normals: vec![[0.0; 3]; vertices],
                    textured: model.0.texture().is_some(),
                    wind: Vec3::ZERO,
                    drawn: false,
                    refused: None,
                }));
            }
            Err(error) => {
                tracing::error!("garment {entity}: {error}");
                state.0 = State::Failed(error, wanted);
            }
        }
    }
}

/// A character as the engine takes it: all joints that its skins name.
#[derive(Default)]
struct Figure {
    joints: Vec<Entity>,
    names: Vec<String>,
    binds: Vec<[f32; 16]>,
    positions: Vec<[f32; 3]>,
    body_joints: Vec<u32>,
    weights: Vec<f32>,
    triangles: Vec<[u32; 3]>,
}

impl Characters<'_, '_> {
    /// `None` while no skinned mesh is there or something of it is still loading.
    fn figure(&self, garment: &Garment, meshes: &Assets<Mesh>) -> Option<Figure> {
        let below = self.children.iter_descendants(garment.wearer);
        let skins: Vec<_> =
            std::iter::once(garment.wearer).chain(below).filter_map(|entity| self.skins.get(entity).ok()).collect();
        let mut figure = Figure::default();
        let mut index_of: HashMap<Entity, u32> = HashMap::default();
        let mut inverses = Vec::new();
        for (skin, _) in &skins {
            let binds = self.binds.get(&skin.inverse_bindposes)?;
            for (&joint, &inverse) in skin.joints.iter().zip(binds.iter()) {
                if let bevy::platform::collections::hash_map::Entry::Vacant(place) = index_of.entry(joint) {
                    place.insert(figure.joints.len() as u32);
                    figure.joints.push(joint);
                    figure.names.push(self.names.get(joint).map(|name| name.to_string()).unwrap_or_default());
                    inverses.push(inverse);
                }
            }
        }
        let top = *figure.joints.iter().find(|joint| {
            self.parents.get(**joint).is_ok_and(|parent| !index_of.contains_key(&parent.parent()))
                || self.parents.get(**joint).is_err()
        })?;
        let bound = self.bound_to_wearer(&figure.joints, &inverses, top, garment.wearer);
        figure.binds = inverses.iter().map(|inverse| (bound * inverse.inverse()).to_cols_array()).collect();
        if garment.fit == GarmentFit::Body {
            for (skin, mesh) in &skins {
                figure.add_skin(meshes.get(&mesh.0)?, skin, &index_of, bound);
            }
        }
        Some(figure)
    }

    /// From the space in which joints were bound to that of the wearer, at its size in the world. Files choose that
    /// space: the skeleton's, whose turn and scale stand in nodes above it, or the wearer's. The size of a joint today
    /// over its size when bound tells which, in any pose.
    fn bound_to_wearer(&self, joints: &[Entity], inverses: &[Mat4], top: Entity, wearer: Entity) -> Mat4 {
        let moved: Vec<Mat4> =
            joints.iter().zip(inverses).map(|(joint, inverse)| self.below(*joint, wearer).0 * *inverse).collect();
        let size = moved[0].determinant().abs().cbrt();
        let (above, under_wearer) =
            self.parents.get(top).map_or((Mat4::IDENTITY, false), |parent| self.below(parent.parent(), wearer));
        let own = if moved.iter().all(|matrix| matrix.abs_diff_eq(moved[0], 1e-3 * size.max(1e-6))) {
            moved[0] // it stands as it was bound
        } else {
            let turn_of = |matrix: &Mat4| matrix.to_scale_rotation_translation().1;
            let hips = joints.iter().position(|joint| *joint == top).map_or(Quat::IDENTITY, |at| turn_of(&moved[at]));
            let above_turn = turn_of(&above);
            let nearer = hips.angle_between(above_turn) <= hips.angle_between(Quat::IDENTITY);
            let turn = if nearer { above_turn } else { Quat::IDENTITY };
            Mat4::from_scale_rotation_translation(Vec3::splat(size), turn, above.w_axis.truncate())
        };
        let scale = self.globals.get(wearer).map_or(Vec3::ONE, GlobalTransform::scale);
        if under_wearer { Mat4::from_scale(scale) * own } else { own }
    }

    /// From an entity's space to that of the wearer, and whether it stands below it; else to the world's.
    fn below(&self, entity: Entity, wearer: Entity) -> (Mat4, bool) {
        let (mut to, mut at) = (Mat4::IDENTITY, entity);
        while at != wearer {
            if let Ok(local) = self.locals.get(at) {
                to = local.to_matrix() * to;
            }
            let Ok(parent) = self.parents.get(at) else { return (to, false) };
            at = parent.parent();
        }
        (to, true)
    }
}

impl Figure {
    /// Takes the skin of one mesh, if its vertices can be read.
    fn add_skin(&mut self, mesh: &Mesh, skin: &SkinnedMesh, index_of: &HashMap<Entity, u32>, bound: Mat4) {
        let read = |attribute| mesh.try_attribute_option(attribute).ok().flatten();
        let (
            Some(VertexAttributeValues::Float32x3(positions)),
            Some(VertexAttributeValues::Uint16x4(joints)),
            Some(VertexAttributeValues::Float32x4(weights)),
        ) = (read(Mesh::ATTRIBUTE_POSITION), read(Mesh::ATTRIBUTE_JOINT_INDEX), read(Mesh::ATTRIBUTE_JOINT_WEIGHT))
        else {
            tracing::warn!(
                "the vertices of a skin cannot be read (RenderAssetUsages::MAIN_WORLD); it counts for no fit"
            );
            return;
        };
        let indices: Vec<u32> = match mesh.try_indices_option().ok().flatten() {
            Some(Indices::U16(indices)) => indices.iter().map(|index| u32::from(*index)).collect(),
            Some(Indices::U32(indices)) => indices.clone(),
            None => (0..positions.len() as u32).collect(),
        };
        if mesh.primitive_topology() != PrimitiveTopology::TriangleList {
            return;
        }
        let first = self.positions.len() as u32;
        self.positions.extend(positions.iter().map(|point| bound.transform_point3((*point).into()).to_array()));
        for (joints, weights) in joints.iter().zip(weights) {
            for (joint, weight) in joints.iter().zip(weights) {
                // An index past the last joint goes to the engine, which refuses it.
                let entity = skin.joints.get(usize::from(*joint));
                self.body_joints.push(entity.and_then(|joint| index_of.get(joint)).copied().unwrap_or(u32::MAX));
                self.weights.push(*weight);
            }
        }
        self.triangles.extend(indices.chunks_exact(3).map(|corners| [0, 1, 2].map(|i| first + corners[i])));
    }
}

fn put_on(model: &Model, garment: &Garment, figure: &Figure) -> Result<(Cloth, Option<Fit>), Error> {
    let mut cloth = Cloth::new(model)?;
    cloth.set_space(&garment.space)?;
    if garment.fit == GarmentFit::Names {
        cloth.bind_joints(&figure.names)?;
        return Ok((cloth, None));
    }
    let names: Vec<&str> = figure.names.iter().map(String::as_str).collect();
    let body = (!figure.positions.is_empty()).then_some(Body {
        positions: &figure.positions,
        joints: &figure.body_joints,
        weights: &figure.weights,
        triangles: &figure.triangles,
    });
    let character = Character { joint_names: &names, joint_roles: &[], bind: Pose::columns(&figure.binds), body };
    let fit = cloth.fit(&character)?;
    Ok((cloth, Some(fit)))
}

fn mesh_of(model: &Model) -> Mesh {
    let texture = model.texture();
    let mut positions = model.positions().to_vec();
    positions.extend(
        texture.iter().flat_map(|texture| texture.seam_vertices).map(|vertex| model.positions()[usize::from(*vertex)]),
    );
    let triangles = texture.map_or(model.triangles(), |texture| texture.triangles);
    let mesh = Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_NORMAL, vec![[0.0_f32, 1.0, 0.0]; positions.len()])
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, positions)
        .with_inserted_indices(Indices::U16(triangles.iter().flatten().copied().collect()));
    match texture {
        Some(texture) => mesh.with_inserted_attribute(Mesh::ATTRIBUTE_UV_0, texture.coordinates.to_vec()),
        None => mesh,
    }
}
