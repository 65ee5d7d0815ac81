//! Writes the figure of a training bundle as a glTF file that walks: skin, skeleton, and a sequence as its animation.
//!
//! cargo run --example figure_glb -- \
//!   models/skirt/skirt.safetensors models/skirt/sequences/walk_turn.safetensors figure.glb
use std::path::Path;

use bevy::math::{DMat4, DQuat, DVec3, Vec3};
use serde_json::{Value, json};

#[path = "../../dcloth/tests/common/safetensors.rs"]
mod safetensors;
use safetensors::SafeTensors;

const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

/// The binary part of the file, and what lies where in it.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    fn add(&mut self, kind: &str, component: u32, count: usize, data: impl Iterator<Item = [u8; 4]>) -> usize {
        let start = self.bytes.len();
        self.bytes.extend(data.flatten());
        self.views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": self.bytes.len() - start}));
        self.accessors.push(
            json!({"bufferView": self.views.len() - 1, "componentType": component, "count": count, "type": kind}),
        );
        self.accessors.len() - 1
    }

    fn floats<const N: usize>(&mut self, kind: &str, rows: &[[f32; N]]) -> usize {
        let accessor = self.add(kind, F32, rows.len(), rows.iter().flatten().map(|value| value.to_le_bytes()));
        let bound = |of: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N).map(|i| rows.iter().map(|row| row[i]).reduce(of).unwrap_or_default()).collect()
        };
        self.accessors[accessor]["min"] = json!(bound(f32::min));
        self.accessors[accessor]["max"] = json!(bound(f32::max));
        accessor
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [bundle, sequence, output] = &arguments[..] else {
        eprintln!("usage: figure_glb BUNDLE SEQUENCE OUT.glb");
        std::process::exit(2);
    };
    let (bundle, sequence) = (SafeTensors::read(bundle), SafeTensors::read(sequence));
    let names = bundle.names("joint_names");
    assert_eq!(sequence.names("joint_names"), names, "the sequence moves the joints of the bundle");
    let parents: Vec<i64> = serde_json::from_str(bundle.metadata("parents")).expect("parents");
    let parent = |joint: usize| usize::try_from(parents[joint]).ok();
    let double = |m: &[f32; 16]| DMat4::from_cols_array(&m.map(f64::from)).transpose();
    let binds: Vec<DMat4> = bundle.f32::<16>("character.bind").iter().map(double).collect();
    let poses: Vec<DMat4> = sequence.f32::<16>("joint_matrices").iter().map(double).collect();

    let mut buffer = Buffer::default();
    let mesh = skin(&bundle, names.len(), &mut buffer);
    let inverses: Vec<[f32; 16]> = binds.iter().map(|bind| bind.inverse().as_mat4().to_cols_array()).collect();
    let inverses = buffer.floats("MAT4", &inverses);

    let local = |world: &[DMat4], joint: usize| {
        let above = parent(joint).map_or(DMat4::IDENTITY, |parent| world[parent].inverse());
        let (_, rotation, translation) = (above * world[joint]).to_scale_rotation_translation();
        (rotation, translation)
    };
    let frames: Vec<&[DMat4]> = poses.chunks_exact(names.len()).collect();
    let fps: f32 = sequence.metadata("fps").parse().expect("fps");
    let times: Vec<[f32; 1]> = (0..frames.len()).map(|frame| [frame as f32 / fps]).collect();
    let times = buffer.floats("SCALAR", &times);
    let (mut nodes, mut samplers, mut channels) = (Vec::new(), Vec::new(), Vec::new());
    for (joint, name) in names.iter().enumerate() {
        let children: Vec<usize> = (0..names.len()).filter(|&child| parent(child) == Some(joint)).collect();
        let (rotation, translation) = local(&binds, joint);
        let mut node =
            json!({"name": name, "rotation": floats(rotation), "translation": translation.as_vec3().to_array()});
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        nodes.push(node);
        let mut keys: Vec<(DQuat, DVec3)> = frames.iter().map(|frame| local(frame, joint)).collect();
        for frame in 1..keys.len() {
            if keys[frame].0.dot(keys[frame - 1].0) < 0.0 {
                keys[frame].0 = -keys[frame].0;
            }
        }
        let rotations: Vec<[f32; 4]> = keys.iter().map(|key| floats(key.0)).collect();
        let translations: Vec<[f32; 3]> = keys.iter().map(|key| key.1.as_vec3().to_array()).collect();
        for (path, keys) in
            [("rotation", buffer.floats("VEC4", &rotations)), ("translation", buffer.floats("VEC3", &translations))]
        {
            channels.push(json!({"sampler": samplers.len(), "target": {"node": joint, "path": path}}));
            samplers.push(json!({"input": times, "output": keys, "interpolation": "LINEAR"}));
        }
    }
    let roots: Vec<usize> = (0..names.len()).filter(|&joint| parent(joint).is_none()).collect();
    let (body, root) = (names.len(), names.len() + 1);
    nodes.push(json!({"name": "Body", "mesh": 0, "skin": 0}));
    nodes.push(json!({"name": "Figure", "children": roots.into_iter().chain([body]).collect::<Vec<_>>()}));
    let document = json!({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [root]}], "nodes": nodes,
        "buffers": [{"byteLength": buffer.bytes.len()}], "bufferViews": buffer.views, "accessors": buffer.accessors,
        "meshes": [{"primitives": [mesh]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.8}}],
        "skins": [{"joints": (0..names.len()).collect::<Vec<_>>(), "inverseBindMatrices": inverses}],
        "animations": [{"name": sequence.metadata("clip"), "samplers": samplers, "channels": channels}],
    });
    write(Path::new(output), document.to_string(), &buffer.bytes);
}

fn floats(rotation: DQuat) -> [f32; 4] {
    rotation.normalize().to_array().map(|value| value as f32)
}

/// The figure's skin as a primitive, with the four largest weights of each point.
fn skin(bundle: &SafeTensors, joint_count: usize, buffer: &mut Buffer) -> Value {
    let positions = bundle.f32::<3>("body.positions");
    let faces = bundle.i32::<3>("body.faces");
    let mut normals = vec![Vec3::ZERO; positions.len()];
    for face in &faces {
        let [a, b, c] = face.map(|corner| Vec3::from(positions[corner as usize]));
        for corner in face {
            normals[*corner as usize] += (b - a).cross(c - a);
        }
    }
    let normals: Vec<[f32; 3]> = normals.iter().map(|normal| normal.normalize_or(Vec3::Y).to_array()).collect();
    // The bundle has colours as a screen shows them, glTF has them linear.
    let colours: Vec<[f32; 3]> = bundle.f32::<3>("body.colours").iter().map(|c| c.map(|v| v.powf(2.2))).collect();
    let (mut joints, mut weights) = (Vec::new(), Vec::new());
    for row in bundle.f32::<1>("body.joint_weights").chunks_exact(joint_count) {
        let mut order: Vec<usize> = (0..joint_count).collect();
        order.sort_by(|&a, &b| row[b][0].total_cmp(&row[a][0]));
        let sum: f32 = order[..4].iter().map(|&joint| row[joint][0]).sum();
        weights.push(std::array::from_fn::<f32, 4, _>(|i| row[order[i]][0] / sum));
        joints.extend([[order[0], order[1]], [order[2], order[3]]]);
    }
    let pair = |pair: &[usize; 2]| {
        let [a, b] = pair.map(|joint| (joint as u16).to_le_bytes());
        [a[0], a[1], b[0], b[1]]
    };
    let joints = buffer.add("VEC4", U16, positions.len(), joints.iter().map(pair));
    let corners = faces.iter().flatten().map(|corner| (*corner as u32).to_le_bytes());
    let indices = buffer.add("SCALAR", U32, 3 * faces.len(), corners);
    json!({
        "attributes": {
            "POSITION": buffer.floats("VEC3", &positions), "NORMAL": buffer.floats("VEC3", &normals),
            "COLOR_0": buffer.floats("VEC3", &colours), "JOINTS_0": joints,
            "WEIGHTS_0": buffer.floats("VEC4", &weights),
        },
        "indices": indices, "material": 0,
    })
}

fn write(path: &Path, mut document: String, binary: &[u8]) {
    document.push_str(&" ".repeat(document.len().next_multiple_of(4) - document.len()));
    let mut file = Vec::new();
    file.extend(b"glTF");
    for number in [2, 12 + 8 + document.len() + 8 + binary.len(), document.len()] {
        file.extend((number as u32).to_le_bytes());
    }
    file.extend(b"JSON");
    file.extend(document.as_bytes());
    file.extend((binary.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(binary);
    std::fs::write(path, file).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}
