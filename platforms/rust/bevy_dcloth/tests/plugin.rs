//! The plugin in an app without renderer: the figure of training as a skinned mesh, moved by a sequence.
//! `scripts/test_rust.sh` puts skirt.dcloth and what `dcloth run` draws of walk_turn into DCLOTH_RUST_DATA.
use std::path::PathBuf;
use std::time::Duration;

use bevy::asset::AssetPlugin;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::mesh::{Indices, MeshPlugin, PrimitiveTopology, VertexAttributeValues};
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_dcloth::dcloth::{FitWarning, Role, Stages, Status};
use bevy_dcloth::{ClothModel, DclothPlugin, Garment, GarmentFit, GarmentState};

#[path = "../../dcloth/tests/common/safetensors.rs"]
mod safetensors;
use safetensors::SafeTensors;

const ALLOWED_MM: f64 = 0.01;

fn data() -> PathBuf {
    PathBuf::from(std::env::var_os("DCLOTH_RUST_DATA").expect("DCLOTH_RUST_DATA; scripts/test_rust.sh sets it"))
}

fn models(name: &str) -> SafeTensors {
    SafeTensors::read(PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../models/skirt")).join(name))
}

struct Stage {
    app: App,
    wearer: Entity,
    joints: Vec<Entity>,
    frames: Vec<Vec<Mat4>>,
    model: Handle<ClothModel>,
}

impl Stage {
    /// An app whose clock moves by one frame of the sequence, and the figure below an entity of its own.
    fn new() -> Self {
        let walk = models("sequences/walk_turn.safetensors");
        let names = walk.names("joint_names");
        let fps: f64 = walk.metadata("fps").parse().expect("fps");
        let mut app = App::new();
        app.add_plugins((
            MinimalPlugins,
            AssetPlugin { file_path: data().to_string_lossy().into_owned(), ..default() },
            MeshPlugin,
            TransformPlugin,
            DclothPlugin,
        ));
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / fps)));
        let matrices: Vec<Mat4> =
            walk.f32::<16>("joint_matrices").iter().map(|m| Mat4::from_cols_array(m).transpose()).collect();
        let frames = matrices.chunks_exact(names.len()).map(<[Mat4]>::to_vec).collect();

        let bundle = models("skirt.safetensors");
        assert_eq!(bundle.names("joint_names"), names);
        let binds = bundle.f32::<16>("character.bind");
        let inverses: Vec<Mat4> = binds.iter().map(|m| Mat4::from_cols_array(m).transpose().inverse()).collect();
        let world = app.world_mut();
        let wearer = world.spawn((Transform::default(), Name::new("figure"))).id();
        let joints: Vec<Entity> = names
            .iter()
            .map(|name| world.spawn((Transform::default(), Name::new(name.clone()), ChildOf(wearer))).id())
            .collect();
        let mesh = world.resource_mut::<Assets<Mesh>>().add(skin(&bundle, names.len()));
        let inverse_bindposes = world
            .resource_mut::<Assets<SkinnedMeshInverseBindposes>>()
            .add(SkinnedMeshInverseBindposes::from(inverses));
        world.spawn((SkinnedMesh { inverse_bindposes, joints: joints.clone() }, Mesh3d(mesh), ChildOf(wearer)));

        let model: Handle<ClothModel> = app.world().resource::<AssetServer>().load("skirt.dcloth");
        for _wait in 0..2000 {
            app.update();
            if app.world().resource::<Assets<ClothModel>>().contains(&model) {
                return Self { app, wearer, joints, frames, model };
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        panic!("skirt.dcloth was not loaded");
    }

    fn spawn(&mut self, garment: Garment) -> Entity {
        self.app.world_mut().spawn(garment).id()
    }

    /// Moves the figure and draws.
    fn frame(&mut self, frame: usize) {
        for (&joint, matrix) in self.joints.iter().zip(&self.frames[frame]) {
            let mut joint = self.app.world_mut().entity_mut(joint);
            match joint.get_mut::<Transform>() {
                Some(mut transform) => *transform = Transform::from_matrix(*matrix),
                None => {
                    joint.insert(GlobalTransform::from(*matrix));
                }
            }
        }
        self.app.update();
    }

    /// From now on joints have the very matrices of the sequence. A `Transform` rounds them, and where a vertex lies
    /// between two parts of the skin, the last bit of a pose decides which of them pushes it out: 0.5 mm.
    fn without_rounding(&mut self) {
        for joint in &self.joints {
            self.app.world_mut().entity_mut(*joint).remove::<Transform>();
        }
    }

    fn vertices(&self, garment: Entity) -> Vec<[f32; 3]> {
        attribute(self, garment, Mesh::ATTRIBUTE_POSITION.id)
    }

    fn state(&self, garment: Entity) -> &GarmentState {
        self.app.world().get(garment).expect("the plugin adds a state")
    }
}

fn attribute(stage: &Stage, garment: Entity, id: bevy::mesh::MeshVertexAttributeId) -> Vec<[f32; 3]> {
    let mesh = stage.app.world().get::<Mesh3d>(garment).expect("a mesh");
    match stage.app.world().resource::<Assets<Mesh>>().get(&mesh.0).expect("its asset").attribute(id) {
        Some(VertexAttributeValues::Float32x3(values)) => values.clone(),
        other => panic!("an attribute of three floats, found {other:?}"),
    }
}

/// The figure's skin, with the four largest weights of each point.
fn skin(bundle: &SafeTensors, joint_count: usize) -> Mesh {
    let weights = bundle.f32::<1>("body.joint_weights");
    let (mut joints, mut four) = (Vec::new(), Vec::new());
    for row in weights.chunks_exact(joint_count) {
        let mut order: Vec<usize> = (0..joint_count).collect();
        order.sort_by(|&a, &b| row[b][0].total_cmp(&row[a][0]));
        joints.push(std::array::from_fn::<u16, 4, _>(|i| order[i] as u16));
        four.push(std::array::from_fn::<f32, 4, _>(|i| row[order[i]][0]));
    }
    let faces = bundle.i32::<3>("body.faces").iter().flatten().map(|corner| *corner as u32).collect();
    Mesh::new(PrimitiveTopology::TriangleList, Default::default())
        .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, bundle.f32::<3>("body.positions"))
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, VertexAttributeValues::Uint16x4(joints))
        .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, four)
        .with_inserted_indices(Indices::U32(faces))
}

fn distance_mm(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    assert!(!a.is_empty() && a.iter().chain(b).flatten().all(|value| value.is_finite()));
    let squared = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)).sum::<f64>();
    1000.0 * a.iter().zip(b).map(squared).fold(0.0, f64::max).sqrt()
}

#[test]
fn vertices_are_those_of_the_c_host() {
    for (fit, outside, run) in [
        (GarmentFit::Names, false, "run.safetensors"),
        (GarmentFit::Names, true, "run_outside.safetensors"),
        (GarmentFit::Bones, false, "run.safetensors"),
    ] {
        let mut stage = Stage::new();
        stage.without_rounding();
        let expected = SafeTensors::read(data().join(run)).f32::<3>("positions");
        let garment = Garment { fit, outside_body: outside, ..Garment::new(stage.model.clone(), stage.wearer) };
        let garment = stage.spawn(garment);
        let count = stage.frames.len();
        let model = dcloth::Model::read(data().join("skirt.dcloth")).expect("the skirt");
        let seam = model.texture().expect("texture coordinates").seam_vertices;
        assert!(seam.len() > 100);
        let mut worst: f64 = 0.0;
        for (frame, expected) in expected.chunks_exact(expected.len() / count).enumerate() {
            stage.frame(frame);
            let drawn = stage.vertices(garment);
            let (own, repeated) = drawn.split_at(model.vertex_count());
            worst = worst.max(distance_mm(own, expected));
            let at_seam: Vec<[f32; 3]> = seam.iter().map(|vertex| own[usize::from(*vertex)]).collect();
            assert_eq!(repeated, at_seam);
        }
        println!("{fit:?}, outside_body {outside}: {count} frames, largest distance of a vertex {worst:.6} mm");
        assert!(worst <= ALLOWED_MM, "{fit:?}, outside_body {outside}: {worst} mm");
        let normals = attribute(&stage, garment, Mesh::ATTRIBUTE_NORMAL.id);
        assert!(normals.iter().all(|normal| (Vec3::from(*normal).length() - 1.0).abs() < 1e-3));
        assert!(stage.state(garment).error().is_none());
    }
}

#[test]
fn fits_to_a_skin_that_was_bound_below_its_armature() {
    fits_to_the_skin(true);
}

#[test]
fn fits_to_a_skin_that_was_bound_beside_its_armature() {
    fits_to_the_skin(false);
}

/// `below`: skin and joints are bound in the space of the armature; else in the wearer's, as exporters differ.
fn fits_to_the_skin(below: bool) {
    let mut stage = Stage::new();
    // A node above the skeleton that turns and scales, as files of Blender have, and a wearer of its own size and
    // place.
    let turn =
        Transform::from_rotation(Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2)).with_scale(Vec3::splat(0.01));
    let above = turn.to_matrix().inverse();
    let world = stage.app.world_mut();
    let armature = world.spawn((turn, ChildOf(stage.wearer))).id();
    for joint in &stage.joints {
        world.entity_mut(*joint).insert(ChildOf(armature));
    }
    let (handle, mesh) = {
        let mut skins = world.query::<(&SkinnedMesh, &Mesh3d)>();
        let (skin, mesh) = skins.single(world).expect("one skin");
        (skin.inverse_bindposes.clone(), mesh.0.clone())
    };
    let mut binds = world.resource_mut::<Assets<SkinnedMeshInverseBindposes>>();
    let bound = if below { above } else { Mat4::IDENTITY };
    let moved: Vec<Mat4> =
        binds.get(&handle).expect("binds").iter().map(|inverse| *inverse * bound.inverse()).collect();
    binds.insert(&handle, moved.into()).expect("a place");
    let mut meshes = world.resource_mut::<Assets<Mesh>>();
    let mut mesh = meshes.get_mut(&mesh).expect("the skin");
    let Some(VertexAttributeValues::Float32x3(points)) = mesh.attribute_mut(Mesh::ATTRIBUTE_POSITION) else {
        panic!("points")
    };
    for point in points {
        *point = bound.transform_point3(Vec3::from(*point)).to_array();
    }
    drop(mesh);
    stage.frames.truncate(20);
    for matrix in stage.frames.iter_mut().flatten() {
        *matrix = above * *matrix; // local to the armature
    }
    let place =
        Transform::from_xyz(3.0, 0.0, -2.0).with_rotation(Quat::from_rotation_y(1.0)).with_scale(Vec3::splat(1.5));
    *stage.app.world_mut().get_mut::<Transform>(stage.wearer).expect("the wearer") = place;

    let garment = stage.spawn(Garment::new(stage.model.clone(), stage.wearer));
    for frame in 0..20 {
        stage.frame(frame);
    }
    let state = stage.state(garment);
    assert!(state.error().is_none() && state.is_dressed(), "{:?}", state.error());
    let fit = state.fit().expect("a fit");
    assert!((fit.scale - 1.5).abs() < 0.03 && (fit.waist_ratio - 1.0).abs() < 0.05, "{fit:?}");
    assert!(!fit.warnings.contains(&FitWarning::Proportions) && !fit.warnings.contains(&FitWarning::Gap));
    let hips = state.joints()[fit.joint(Role::Hips).expect("hips")];
    assert_eq!(stage.app.world().get::<Name>(hips).expect("a name").as_str(), "Hips");
    // The garment hangs around the hips, half as large again.
    let hips = stage.app.world().get::<GlobalTransform>(hips).expect("a joint").translation();
    let vertices = stage.vertices(garment);
    let middle = vertices.iter().map(|vertex| Vec3::from(*vertex)).sum::<Vec3>() / vertices.len() as f32;
    assert!((middle - hips).with_y(0.0).length() < 0.3 && middle.y < hips.y, "{middle} beside {hips}");
}

#[test]
fn says_what_is_wrong_once_and_goes_on() {
    let mut stage = Stage::new();
    stage.frame(0);

    // Nothing to wear it on: it waits.
    let empty = stage.app.world_mut().spawn_empty().id();
    let waiting = stage.spawn(Garment::new(stage.model.clone(), empty));
    stage.frame(0);
    assert!(!stage.state(waiting).is_dressed() && stage.state(waiting).error().is_none());

    // Joints without names.
    let names: Vec<Name> = stage
        .joints
        .clone()
        .into_iter()
        .map(|joint| stage.app.world_mut().entity_mut(joint).take::<Name>().expect("a name"))
        .collect();
    let nameless = stage.spawn(Garment { fit: GarmentFit::Bones, ..Garment::new(stage.model.clone(), stage.wearer) });
    stage.frame(0);
    assert_eq!(stage.state(nameless).error().expect("an error").status(), Status::Joints);
    for (joint, name) in stage.joints.clone().into_iter().zip(names) {
        stage.app.world_mut().entity_mut(joint).insert(name);
    }

    // Another wearer: it is put on again.
    stage.app.world_mut().get_mut::<Garment>(waiting).expect("a garment").wearer = stage.wearer;
    stage.app.world_mut().get_mut::<Garment>(waiting).expect("a garment").fit = GarmentFit::Names;
    stage.frame(0);
    assert!(stage.state(waiting).is_dressed());
    let before = stage.vertices(waiting);

    // A broken pose is refused, the mesh stays, and the next good pose is drawn.
    let good = stage.frames[1].clone();
    stage.frames[1][0].w_axis.x = f32::NAN;
    stage.frame(1);
    assert_eq!(stage.state(waiting).error().expect("an error").status(), Status::Pose);
    assert!(stage.vertices(waiting) == before);
    stage.frames[1] = good;
    let mut garment = stage.app.world_mut().get_mut::<Garment>(waiting).expect("a garment");
    (garment.jumped, garment.stages, garment.pipelined) = (true, Stages::Static, true);
    garment.wind = Vec3::new(0.0, 0.0, 5.0);
    stage.frame(1);
    assert!(stage.state(waiting).error().is_none());
    assert!(!stage.app.world().get::<Garment>(waiting).expect("a garment").jumped);
    assert!(stage.vertices(waiting) != before);
    let mut state = stage.app.world_mut().get_mut::<GarmentState>(waiting).expect("a state");
    let cloth = state.cloth_mut().expect("a cloth");
    let saved = cloth.save().expect("a state");
    cloth.restore(&saved).expect("the state");

    // The character leaves.
    stage.app.world_mut().entity_mut(stage.wearer).despawn();
    stage.app.update();
    assert!(stage.state(waiting).error().is_none());
}
