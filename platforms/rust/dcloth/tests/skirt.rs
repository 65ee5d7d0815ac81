//! The bundled skirt through the safe types. `scripts/test_rust.sh` puts into DCLOTH_RUST_DATA: skirt.dcloth, and what
//! `dcloth run` draws of walk_turn, as run.safetensors and (with --outside-body) run_outside.safetensors.
use std::path::{Path, PathBuf};

use dcloth::{Axis, Body, Character, Cloth, Frame, Model, Output, Parent, Pose, Role, Space, Stages, Status};

#[path = "common/safetensors.rs"]
mod safetensors;
use safetensors::SafeTensors;

const ALLOWED_MM: f64 = 0.01;

fn data(name: &str) -> PathBuf {
    Path::new(&std::env::var_os("DCLOTH_RUST_DATA").expect("DCLOTH_RUST_DATA; scripts/test_rust.sh sets it")).join(name)
}

fn skirt() -> Model {
    Model::read(data("skirt.dcloth")).expect("the skirt opens")
}

struct Walk {
    names: Vec<String>,
    seconds: f32,
    frames: Vec<Vec<[f32; 16]>>, // rows follow each other
}

fn walk() -> Walk {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../models/skirt/sequences/walk_turn.safetensors");
    let file = SafeTensors::read(path);
    let names = file.names("joint_names");
    let matrices = file.f32::<16>("joint_matrices");
    let frames: Vec<_> = matrices.chunks_exact(names.len()).map(<[_]>::to_vec).collect();
    assert!(frames.len() > 100);
    Walk { names, seconds: 1.0 / file.metadata("fps").parse::<f32>().expect("fps"), frames }
}

fn bound(model: &Model, walk: &Walk) -> Cloth {
    let mut cloth = Cloth::new(model).expect("a cloth");
    cloth.bind_joints(&walk.names).expect("the joints");
    cloth
}

fn play(cloth: &mut Cloth, walk: &Walk, frames: std::ops::Range<usize>) -> Vec<Vec<[f32; 3]>> {
    let vertices = cloth.model().vertex_count();
    frames
        .map(|frame| {
            let mut positions = vec![[f32::NAN; 3]; vertices];
            let pose = Pose::rows(&walk.frames[frame]);
            cloth.update(&pose, &Frame::new(walk.seconds), Output::new(&mut positions)).expect("a frame");
            positions
        })
        .collect()
}

fn distance_mm(a: &[[f32; 3]], b: &[[f32; 3]]) -> f64 {
    assert_eq!(a.len(), b.len());
    assert!(!a.is_empty() && a.iter().chain(b).flatten().all(|value| value.is_finite()));
    let squared = |(a, b): (&[f32; 3], &[f32; 3])| (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)).sum::<f64>();
    1000.0 * a.iter().zip(b).map(squared).fold(0.0, f64::max).sqrt()
}

#[test]
fn vertices_are_those_of_the_c_host() {
    let (model, walk) = (skirt(), walk());
    for (name, outside) in [("run.safetensors", false), ("run_outside.safetensors", true)] {
        let expected = SafeTensors::read(data(name)).f32::<3>("positions");
        assert_eq!(expected.len(), walk.frames.len() * model.vertex_count());
        let mut cloth = bound(&model, &walk);
        let (mut positions, mut normals) = (vec![[0.0; 3]; model.vertex_count()], vec![[0.0; 3]; model.vertex_count()]);
        let mut worst: f64 = 0.0;
        for (matrices, expected) in walk.frames.iter().zip(expected.chunks_exact(model.vertex_count())) {
            let output = Output::new(&mut positions).normals(&mut normals).outside_body(outside);
            cloth.update(&Pose::rows(matrices), &Frame::new(walk.seconds), output).expect("a frame");
            worst = worst.max(distance_mm(&positions, expected));
            assert!(normals.iter().all(|n| (n.iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-3));
        }
        println!("{name}: {} frames, largest distance of a vertex {worst:.6} mm", walk.frames.len());
        assert!(worst <= ALLOWED_MM, "{name}: {worst} mm");
    }
}

#[test]
fn a_texture_repeats_vertices_at_seams() {
    let (model, walk) = (skirt(), walk());
    let texture = model.texture().expect("texture coordinates");
    let (n, drawn) = (model.vertex_count(), texture.coordinates.len());
    assert!(drawn > n && drawn == n + texture.seam_vertices.len());
    assert!(texture.coordinates.iter().flatten().all(|place| (0.0..=1.0).contains(place)));
    let expected = play(&mut bound(&model, &walk), &walk, 0..5);
    let mut cloth = bound(&model, &walk);
    let (mut positions, mut normals, mut tangents) =
        (vec![[0.0; 3]; drawn], vec![[0.0; 3]; drawn], vec![[0.0; 4]; drawn]);
    for matrices in &walk.frames[0..5] {
        let output = Output::new(&mut positions)
            .normals(&mut normals)
            .tangents(&mut tangents, texture.coordinates)
            .textured(true);
        cloth.update(&Pose::rows(matrices), &Frame::new(walk.seconds), output).expect("a frame");
    }
    for (plain, textured) in model.triangles().iter().flatten().zip(texture.triangles.iter().flatten()) {
        assert_eq!(positions[usize::from(*textured)], expected[4][usize::from(*plain)]);
    }
    assert!(tangents.iter().all(|t| (t[..3].iter().map(|v| v * v).sum::<f32>() - 1.0).abs() < 1e-3));
    let output = Output::new(&mut positions[..n]).textured(true);
    let error = cloth.update(&Pose::rows(&walk.frames[5]), &Frame::new(walk.seconds), output).unwrap_err();
    assert_eq!(error.status(), Status::Argument);
}

#[test]
fn the_comparison_sees_a_fault() {
    let (model, walk) = (skirt(), walk());
    let mut late = bound(&model, &walk);
    let expected = play(&mut bound(&model, &walk), &walk, 0..20);
    late.set_wind([0.0, 0.0, -4.0]).expect("wind");
    assert!(model.reads_wind());
    assert!(distance_mm(&play(&mut late, &walk, 0..20)[19], &expected[19]) > 1.0);
}

#[test]
fn describes_the_model() {
    let model = skirt();
    assert_eq!((model.name().as_str(), model.precision().as_str()), ("skirt", "int8"));
    assert_eq!(model.stages(), Stages::Mesh);
    assert_eq!(model.format().0, 1);
    assert!((model.tick_seconds() - 1.0 / 30.0).abs() < 1e-6);
    let names: Vec<String> = model.joint_names().collect();
    assert_eq!(names.len(), model.joint_count());
    let hips = names.iter().position(|name| name == "Hips").expect("hips");
    let knee = names.iter().position(|name| name == "LeftLeg").expect("a knee");
    assert_eq!(model.joint_parent(hips), Parent::Top);
    assert!(matches!(model.joint_parent(knee), Parent::Joint(above) if names[above] == "LeftUpLeg"));
    assert_eq!(model.joint_parent(names.len()), Parent::Unknown);
    assert_eq!(model.joint_bind(names.len()).unwrap_err().status(), Status::Argument);
    assert!(model.joint_bind(knee).expect("a matrix")[3] > 0.0, "left is +X");
    assert!(model.triangles().iter().flatten().all(|corner| usize::from(*corner) < model.vertex_count()));
    assert!(model.body_vertex_count() > 0 && model.cloth_bytes() > 1 << 16);
    assert!(!dcloth::isa_name().is_empty() && dcloth::version().starts_with("0."));
}

#[test]
fn interleaved_buffers_hold_the_same() {
    let (model, walk) = (skirt(), walk());
    let expected = play(&mut bound(&model, &walk), &walk, 0..3);
    let mut cloth = bound(&model, &walk);
    let mut buffer = vec![7.0; 9 * model.vertex_count()];
    let mut bounds = [[0.0; 3]; 2];
    for frame in 0..3 {
        let output = Output::interleaved(&mut buffer, 9, 1, Some(5)).bounds(&mut bounds);
        cloth.update(&Pose::rows(&walk.frames[frame]), &Frame::new(walk.seconds), output).expect("a frame");
    }
    for (vertex, expected) in buffer.chunks_exact(9).zip(&expected[2]) {
        assert_eq!(vertex[1..4], *expected);
        assert_eq!([vertex[0], vertex[4], vertex[8]], [7.0; 3], "floats between are left as they are");
        assert!((0..3).all(|i| bounds[0][i] <= expected[i] && expected[i] <= bounds[1][i]));
    }
    let (pose, frame) = (Pose::rows(&walk.frames[0]), Frame::new(walk.seconds));
    let floats = buffer.len();
    for output in [
        Output::interleaved(&mut buffer[..floats - 1], 9, 0, None),
        Output::interleaved(&mut vec![0.0; floats], 9, 7, None),
        Output::interleaved(&mut vec![0.0; floats], 9, 0, Some(usize::MAX - 1)),
        Output::interleaved(&mut vec![0.0; floats], 9, 0, Some(2)),
        Output::interleaved(&mut [], 0, 0, None),
    ] {
        assert_eq!(cloth.update(&pose, &frame, output).unwrap_err().status(), Status::Argument);
    }
}

#[test]
fn tangents_follow_the_texture() {
    let (model, walk) = (skirt(), walk());
    let mut cloth = bound(&model, &walk);
    let n = model.vertex_count();
    let (mut positions, mut normals, mut tangents) = (vec![[0.0; 3]; n], vec![[0.0; 3]; n], vec![[0.0; 4]; n]);
    let coordinates: Vec<[f32; 2]> = model.positions().iter().map(|p| [p[2].atan2(p[0]), p[1]]).collect();
    let output = Output::new(&mut positions).normals(&mut normals).tangents(&mut tangents, &coordinates);
    cloth.update(&Pose::rows(&walk.frames[0]), &Frame::new(walk.seconds), output).expect("a frame");
    for (tangent, normal) in tangents.iter().zip(&normals) {
        assert!(tangent[3].abs() == 1.0 && (0..3).map(|i| tangent[i] * normal[i]).sum::<f32>().abs() < 1e-3);
    }
    let output = Output::new(&mut positions).normals(&mut normals).tangents(&mut tangents, &coordinates[1..]);
    let error = cloth.update(&Pose::rows(&walk.frames[0]), &Frame::new(0.0), output).unwrap_err();
    assert_eq!((error.status(), error.what()), (Status::Argument, Some("texture_coordinates")));
}

#[test]
fn states_go_on_bit_for_bit() {
    let (model, walk) = (skirt(), walk());
    let mut cloth = bound(&model, &walk);
    play(&mut cloth, &walk, 0..30);
    let state = cloth.save().expect("a state");
    let expected = play(&mut cloth, &walk, 30..40);
    let mut restored = bound(&model, &walk);
    restored.restore(&state).expect("the state");
    assert!(play(&mut restored, &walk, 30..40) == expected);
    for size in [0, 1, state.len() / 2, state.len() - 1] {
        assert_eq!(restored.restore(&state[..size]).unwrap_err().status(), Status::Format);
    }
    restored.restore_other_model(&state).expect("the same model is another one too");
    restored.reset();
    assert!(restored.describe().tick_waits);
    assert!(play(&mut restored, &walk, 0..3) == play(&mut bound(&model, &walk), &walk, 0..3));
}

#[test]
fn a_space_turns_poses_and_vertices() {
    let (model, walk) = (skirt(), walk());
    // Blender's: x, y, z = left, back, up.
    let turn = |p: [f32; 3]| [p[0], -p[2], p[1]];
    let mut turned = Walk { names: walk.names.clone(), seconds: walk.seconds, frames: walk.frames[..10].to_vec() };
    for matrix in turned.frames.iter_mut().flatten() {
        for column in 0..4 {
            let [x, y, z] = turn([matrix[column], matrix[4 + column], matrix[8 + column]]);
            (matrix[column], matrix[4 + column], matrix[8 + column]) = (x, y, z);
        }
        for row in 0..3 {
            let [x, y, z] = turn([matrix[4 * row], matrix[4 * row + 1], matrix[4 * row + 2]]);
            (matrix[4 * row], matrix[4 * row + 1], matrix[4 * row + 2]) = (x, y, z);
        }
    }
    let expected = play(&mut bound(&model, &walk), &walk, 0..10);
    let mut cloth = bound(&model, &turned);
    cloth.set_space(&Space::BLENDER).expect("a space");
    let expected: Vec<[f32; 3]> = expected[9].iter().map(|p| turn(*p)).collect();
    assert!(distance_mm(&play(&mut cloth, &turned, 0..10)[9], &expected) < ALLOWED_MM);
    let flat = Space::new(Axis::X, Axis::MinusX, Axis::Z, 1.0);
    assert_eq!(cloth.set_space(&flat).unwrap_err().status(), Status::Argument);
}

#[test]
fn fits_by_role() {
    let model = skirt();
    let names: Vec<String> = model.joint_names().collect();
    let binds: Vec<[f32; 16]> = (0..names.len()).map(|joint| model.joint_bind(joint).expect("a matrix")).collect();
    let renamed: Vec<String> = (0..names.len()).map(|joint| format!("b{joint}")).collect();
    let renamed: Vec<&str> = renamed.iter().map(String::as_str).collect();
    let roles: Vec<Option<Role>> = names.iter().map(|name| Role::of_name(name)).collect();
    let by_role = Character { joint_names: &renamed, joint_roles: &roles, bind: Pose::rows(&binds), body: None };
    let mut cloth = Cloth::new(&model).expect("a cloth");
    let fit = cloth.fit(&by_role).expect("a fit");
    assert!((fit.scale - 1.0).abs() < 0.01 && fit.stance_degrees < 1.0, "{fit:?}");
    let hips = fit.joint(Role::Hips).expect("hips");
    assert_eq!(names[hips], "Hips");
    assert!((fit.ratio(Role::LeftUpperLeg).expect("a thigh") - 1.0).abs() < 0.01);
    assert_eq!(
        cloth.set_space(&Space::UNITY).unwrap_err().status(),
        Status::Argument,
        "a fitted cloth keeps its space"
    );

    // A skirt on its own figure falls as without a fit.
    let walk = walk();
    let expected = play(&mut bound(&model, &walk), &walk, 0..20);
    let at = |name: &String| walk.names.iter().position(|of| of == name).expect("a joint of the model");
    let order: Vec<usize> = names.iter().map(at).collect();
    let frames = walk.frames.iter().map(|frame| order.iter().map(|joint| frame[*joint]).collect()).collect();
    let own = Walk { names, seconds: walk.seconds, frames };
    let distance = distance_mm(&play(&mut cloth, &own, 0..20)[19], &expected[19]);
    println!("fitted to its own figure, frame 19: {distance:.4} mm from without a fit");
    assert!(distance < 5.0, "{distance} mm");

    let nameless = Character { joint_roles: &[], ..by_role };
    let error = cloth.fit(&nameless).unwrap_err();
    assert_eq!(error.status(), Status::Joints);
    assert!(error.what().is_some() || error.found().is_some(), "{error}");
    let fewer = Character { joint_names: &renamed[1..], ..by_role };
    assert_eq!(cloth.fit(&fewer).unwrap_err().status(), Status::Argument);
    assert!(Role::ALL.iter().all(|role| Role::of_name(role.name()).is_some()));
}

#[test]
fn fits_to_a_skin() {
    let model = skirt();
    let bundle = SafeTensors::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../models/skirt/skirt.safetensors"));
    let names = bundle.names("joint_names");
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let binds = bundle.f32::<16>("character.bind");
    let positions = bundle.f32::<3>("body.positions");
    let triangles: Vec<[u32; 3]> =
        bundle.i32::<3>("body.faces").iter().map(|t| t.map(|corner| corner as u32)).collect();
    let all = bundle.f32::<1>("body.joint_weights");
    let mut joints = Vec::new();
    let mut weights = Vec::new();
    for row in all.chunks_exact(names.len()) {
        let mut order: Vec<u32> = (0..names.len() as u32).collect();
        order.sort_by(|&a, &b| row[b as usize][0].total_cmp(&row[a as usize][0]));
        joints.extend(&order[..4]);
        weights.extend(order[..4].iter().map(|&joint| row[joint as usize][0]));
    }
    let body = Body { positions: &positions, joints: &joints, weights: &weights, triangles: &triangles };
    let character = Character { joint_names: &names, joint_roles: &[], bind: Pose::rows(&binds), body: Some(body) };
    let mut cloth = Cloth::new(&model).expect("a cloth");
    for _again in 0..2 {
        let fit = cloth.fit(&character).expect("a fit");
        assert!((fit.scale - 1.0).abs() < 0.02 && (fit.waist_ratio - 1.0).abs() < 0.05, "{fit:?}");
    }
    let mut positions_drawn = vec![[f32::NAN; 3]; model.vertex_count()];
    let output = Output::new(&mut positions_drawn).outside_body(true);
    cloth.update(&Pose::rows(&binds), &Frame::new(0.1), output).expect("a frame");
    assert!(positions_drawn.iter().flatten().all(|value| value.is_finite()));

    let mut wrong = joints.clone();
    wrong[17] = names.len() as u32;
    let outside = Body { joints: &wrong, ..body };
    let error = cloth.fit(&Character { body: Some(outside), ..character }).unwrap_err();
    assert_eq!(error.status(), Status::Argument);
    let ragged = Body { weights: &weights[1..], ..body };
    assert_eq!(cloth.fit(&Character { body: Some(ragged), ..character }).unwrap_err().status(), Status::Argument);
}

#[test]
fn a_refused_call_changes_nothing_and_says_why() {
    let (model, walk) = (skirt(), walk());
    let mut cloth = bound(&model, &walk);
    let mut positions = vec![[1.0; 3]; model.vertex_count()];
    let frame = Frame::new(walk.seconds);

    let mut broken = walk.frames[0].clone();
    broken[3][7] = f32::NAN;
    let error = cloth.update(&Pose::rows(&broken), &frame, Output::new(&mut positions)).unwrap_err();
    assert_eq!(error.status(), Status::Pose);
    assert!(
        error.to_string().starts_with("POSE: ") && error.found().is_some() && error.allowed().is_some(),
        "{error:?}"
    );
    assert!(positions.iter().flatten().all(|value| *value == 1.0));

    let pose = Pose::rows(&walk.frames[0]);
    let error = cloth.update(&Pose::rows(&walk.frames[0][1..]), &frame, Output::new(&mut positions)).unwrap_err();
    assert_eq!(error.status(), Status::Pose);
    let error = cloth.update(&pose, &Frame::new(-1.0), Output::new(&mut positions)).unwrap_err();
    assert_eq!(error.status(), Status::Argument);
    let error = cloth.update(&pose, &frame, Output::new(&mut positions[1..])).unwrap_err();
    assert_eq!((error.status(), error.what()), (Status::Argument, Some("positions")));
    let mut short = vec![[0.0; 3]; 3];
    let error = cloth.update(&pose, &frame, Output::new(&mut positions).normals(&mut short)).unwrap_err();
    assert_eq!(error.what(), Some("normals"));
    assert_eq!(cloth.update_unseen(&Pose::columns(&[]), &frame).unwrap_err().status(), Status::Pose);

    let error = cloth.bind_joints(&["Hips", "LeftUpLeg"]).unwrap_err();
    assert_eq!(error.status(), Status::Joints);
    assert!(error.text().contains("'Spine'"), "{error}");
    assert_eq!(cloth.bind_joints(&["a\0b"]).unwrap_err().status(), Status::Argument);
    assert_eq!(cloth.bind_joints::<&str>(&[]).unwrap_err().status(), Status::Argument);
    assert_eq!(cloth.set_wind([f32::NAN; 3]).unwrap_err().status(), Status::Argument);
    assert_eq!(cloth.set_bind_pose(&Pose::rows(&broken)).unwrap_err().status(), Status::Pose);
    assert!(play(&mut cloth, &walk, 0..3) == play(&mut bound(&model, &walk), &walk, 0..3), "nothing has changed");

    assert_eq!(Model::read("no such file").unwrap_err().status(), Status::Io);
    let bytes = std::fs::read(data("skirt.dcloth")).expect("the skirt");
    for size in [0, 1, 63, 64, 4096, bytes.len() - 64] {
        assert!(matches!(Model::open(&bytes[..size]).unwrap_err().status(), Status::Format | Status::Argument));
    }
}

#[test]
fn cloths_move_between_threads() {
    let walk = walk();
    let model = skirt();
    let expected = play(&mut bound(&model, &walk), &walk, 0..8);
    let mut cloths: Vec<Cloth> = (0..3).map(|_| bound(&model, &walk)).collect();
    drop(model); // each cloth keeps it
    std::thread::scope(|scope| {
        for cloth in &mut cloths {
            scope.spawn(|| assert!(play(cloth, &walk, 0..8) == expected));
        }
    });
    let moved = std::thread::spawn(move || cloths.pop().expect("a cloth").model().name());
    assert_eq!(moved.join().expect("a thread"), "skirt");
}

#[test]
fn flags_reach_the_engine() {
    let (model, walk) = (skirt(), walk());
    let mut cloth = bound(&model, &walk);
    let pose = Pose::rows(&walk.frames[0]);
    cloth.update_unseen(&pose, &Frame::new(0.01).hold(true)).expect("a frame");
    assert!(cloth.describe().tick_waits);
    cloth.update_unseen(&pose, &Frame::new(0.01)).expect("a frame");
    assert!(!cloth.describe().tick_waits);
    let in_work = (0..10).filter(|_| {
        cloth.update_unseen(&pose, &Frame::new(0.008).pipelined(true)).expect("a frame");
        cloth.describe().in_work
    });
    assert!((1..10).contains(&in_work.count()));
    for _idle in 0..400 {
        cloth.update_unseen(&pose, &Frame::new(1.0 / 30.0).freeze_idle(true).stages(Stages::Static)).expect("a frame");
    }
    assert!(cloth.describe().frozen);
    cloth.update_unseen(&pose, &Frame::new(0.02).freeze_idle(true).freeze_idle(false)).expect("a frame");
    assert!(!cloth.describe().frozen);
}
