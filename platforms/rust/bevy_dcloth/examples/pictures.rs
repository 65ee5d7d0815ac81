//! Dresses an animated character and draws it, without a window: a glTF file in, PNG pictures out. A software Vulkan,
//! such as Mesa's lavapipe, is enough.
//!
//! cargo run --example pictures -- skirt.dcloth figure.glb pictures [--fit body|bones|names] [--clip NAME] \
//!     [--frames 150] [--every 30]
//!
//! `--record` also writes poses.safetensors, which `dcloth run` plays, and vertices.safetensors, what was drawn of
//! them.
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use bevy::asset::{AssetPlugin, UnapprovedPathMode};
use bevy::camera::RenderTarget;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::gltf::Gltf;
use bevy::light::{CascadeShadowConfigBuilder, GlobalAmbientLight};
use bevy::mesh::VertexAttributeValues;
use bevy::prelude::*;
use bevy::render::RenderPlugin;
use bevy::render::render_resource::TextureFormat;
use bevy::render::view::screenshot::{Screenshot, save_to_disk};
use bevy::time::TimeUpdateStrategy;
use bevy::window::{ExitCondition, WindowPlugin};
use bevy_dcloth::{ClothModel, DclothPlugin, Garment, GarmentFit, GarmentState};

#[path = "../../dcloth/tests/common/safetensors.rs"]
mod safetensors;
use safetensors::SafeTensors;

const SIZE: u32 = 720;
const FPS: f64 = 30.0;

struct Options {
    model: PathBuf,
    character: PathBuf,
    folder: PathBuf,
    fit: GarmentFit,
    clip: Option<String>,
    frames: usize,
    every: usize,
    record: bool,
}

fn options() -> Result<Options, String> {
    let mut paths = Vec::new();
    let (mut fit, mut clip, mut frames, mut every, mut record) = (GarmentFit::Body, None, 150, 30, false);
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or(format!("{argument} needs a value"));
        match argument.as_str() {
            "--fit" => {
                fit = match value()?.as_str() {
                    "body" => GarmentFit::Body,
                    "bones" => GarmentFit::Bones,
                    "names" => GarmentFit::Names,
                    other => return Err(format!("--fit: found {other}, allowed: body, bones, names")),
                }
            }
            "--clip" => clip = Some(value()?),
            "--frames" => frames = value()?.parse().map_err(|_| "--frames: allowed: a number")?,
            "--every" => every = value()?.parse().ok().filter(|n| *n > 0).ok_or("--every: allowed: 1 and more")?,
            "--record" => record = true,
            path => paths.push(std::path::absolute(path).map_err(|error| error.to_string())?),
        }
    }
    let [model, character, folder] = <[PathBuf; 3]>::try_from(paths).map_err(
        |_| "usage: pictures MODEL CHARACTER.glb FOLDER [--fit F] [--clip C] [--frames N] [--every N] [--record]",
    )?;
    Ok(Options { model, character, folder, fit, clip, frames, every, record })
}

fn main() {
    let options = options().unwrap_or_else(|why| fail(&why));
    std::fs::create_dir_all(&options.folder).unwrap_or_else(|error| fail(&error.to_string()));
    let mut app = App::new();
    app.add_plugins((
        DefaultPlugins
            .set(WindowPlugin { primary_window: None, exit_condition: ExitCondition::DontExit, ..default() })
            .set(AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() })
            .set(RenderPlugin { synchronous_pipeline_compilation: true, ..default() }),
        DclothPlugin,
    ));
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    app.finish();
    app.cleanup();

    let assets = app.world().resource::<AssetServer>().clone();
    let model: Handle<ClothModel> = assets.load(options.model.clone());
    let character: Handle<Gltf> = assets.load(options.character.clone());
    until(&mut app, "the files are loaded", |app| {
        let assets = app.world().resource::<AssetServer>();
        for (id, path) in [(model.id().untyped(), &options.model), (character.id().untyped(), &options.character)] {
            if assets.load_state(id).is_failed() {
                fail(&format!("{} cannot be loaded: {:?}", path.display(), assets.load_state(id)));
            }
        }
        assets.is_loaded_with_dependencies(&model) && assets.is_loaded_with_dependencies(&character)
    });
    let wearer = spawn_character(&mut app, &character, options.clip.as_deref());
    let (camera, target) = spawn_stage(&mut app);
    let material = app.world_mut().resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
        base_color: Color::srgb(0.62, 0.16, 0.22),
        perceptual_roughness: 0.9,
        reflectance: 0.2,
        double_sided: true, // a skirt is seen from inside
        cull_mode: None,
        ..default()
    });
    let loaded = app.world().resource::<Assets<ClothModel>>().get(&model).expect("it was loaded");
    let garment_vertices = loaded.0.vertex_count();
    let garment = Garment { fit: options.fit, ..Garment::new(model, wearer) };
    let garment = app.world_mut().spawn((garment, MeshMaterial3d(material))).id();

    let mut recorded = Recorded::default();
    for frame in 0..options.frames {
        app.update();
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / FPS)));
        let state = app.world().get::<GarmentState>(garment).expect("the plugin adds a state");
        if let Some(error) = state.error() {
            fail(&error.to_string());
        }
        if frame == 0 {
            if !state.is_dressed() {
                fail(&format!("{} has no skinned mesh", options.character.display()));
            }
            match state.fit() {
                Some(fit) => println!("scale {:.3}, warnings: {:?}", fit.scale, fit.warnings),
                None => println!("joints found by name"),
            }
        }
        let vertices = vertices(&app, garment);
        recorded.add(&app, state.joints(), &vertices[..garment_vertices]); // the others repeat a seam's
        if frame % options.every == 0 {
            aim(&mut app, camera, &vertices);
            let path = options.folder.join(format!("frame_{frame:04}.png"));
            picture(&mut app, camera, &target, &path);
        }
    }
    if options.record {
        recorded.write(&options.folder);
    }
    println!("{}: {} pictures", options.folder.display(), options.frames.div_ceil(options.every));
}

fn fail(why: &str) -> ! {
    eprintln!("pictures: {why}");
    std::process::exit(2);
}

/// Runs frames without time until something has happened.
fn until(app: &mut App, what: &str, happened: impl Fn(&mut App) -> bool) {
    for _wait in 0..20_000 {
        app.update();
        if happened(app) {
            return;
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    fail(&format!("waited in vain until {what}"));
}

/// The scene of the file, with a clip playing: the first one if none is named.
fn spawn_character(app: &mut App, character: &Handle<Gltf>, clip: Option<&str>) -> Entity {
    let world = app.world_mut();
    let gltf = world.resource::<Assets<Gltf>>().get(character).expect("it is loaded");
    let scene = gltf.default_scene.clone().or(gltf.scenes.first().cloned()).unwrap_or_else(|| fail("no scene"));
    let found = match clip {
        Some(name) => gltf.named_animations.get(name),
        None => gltf.animations.first(),
    };
    let clip = found.cloned().unwrap_or_else(|| {
        let names: Vec<&str> = gltf.named_animations.keys().map(|name| &**name).collect();
        fail(&format!("found no such clip; allowed: {}", names.join(", ")))
    });
    let (graph, node) = AnimationGraph::from_clip(clip);
    let graph = world.resource_mut::<Assets<AnimationGraph>>().add(graph);
    let wearer = world.spawn(WorldAssetRoot(scene)).id();
    until(app, "the scene is there", |app| {
        let world = app.world_mut();
        let mut players = world.query::<(Entity, &mut AnimationPlayer)>();
        let Ok((entity, mut player)) = players.single_mut(world) else { return false };
        player.play(node).repeat();
        world.entity_mut(entity).insert(AnimationGraphHandle(graph.clone()));
        true
    });
    wearer
}

/// Light, floor, and a camera that draws into an image.
fn spawn_stage(app: &mut App) -> (Entity, Handle<Image>) {
    let world = app.world_mut();
    let target = Image::new_target_texture(SIZE, SIZE, TextureFormat::Rgba8UnormSrgb, None);
    let target = world.resource_mut::<Assets<Image>>().add(target);
    let plane = world.resource_mut::<Assets<Mesh>>().add(Plane3d::default().mesh().size(800.0, 800.0));
    let grey = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial {
        base_color: Color::srgb(0.5, 0.52, 0.55),
        perceptual_roughness: 1.0,
        reflectance: 0.0,
        ..default()
    });
    world.spawn((Mesh3d(plane), MeshMaterial3d(grey)));
    world.insert_resource(ClearColor(Color::srgb(0.85, 0.87, 0.9)));
    world.insert_resource(GlobalAmbientLight { brightness: 500.0, ..default() });
    world.spawn((
        DirectionalLight { illuminance: 5_500.0, shadow_maps_enabled: true, ..default() },
        CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 12.0, ..default() }.build(),
        Transform::from_xyz(2.4, 4.0, 2.2).looking_at(Vec3::ZERO, Vec3::Y),
    ));
    let camera = world.spawn((
        Camera3d::default(),
        Camera { is_active: false, ..default() }, // drawing takes longest: only what is kept is drawn
        RenderTarget::from(target.clone()),
        Projection::from(PerspectiveProjection { fov: 0.56, near: 0.1, far: 500.0, ..default() }),
        Tonemapping::None, // others need tables, or shift colours
        Msaa::Sample4,
    ));
    (camera.id(), target)
}

/// Looks at the character from the front, at the height of the garment.
fn aim(app: &mut App, camera: Entity, vertices: &[[f32; 3]]) {
    let middle = vertices.iter().map(|vertex| Vec3::from(*vertex)).sum::<Vec3>() / vertices.len() as f32;
    let eye = Vec3::new(middle.x + 1.4, 1.35, middle.z + 3.7);
    let looking = Transform::from_translation(eye).looking_at(middle.with_y(0.88), Vec3::Y);
    *app.world_mut().get_mut::<Transform>(camera).expect("a camera") = looking;
}

/// Draws this moment: frames without time move neither character nor cloth.
fn picture(app: &mut App, camera: Entity, target: &Handle<Image>, path: &Path) {
    let still = TimeUpdateStrategy::ManualDuration(Duration::ZERO);
    let step = std::mem::replace(&mut *app.world_mut().resource_mut::<TimeUpdateStrategy>(), still);
    app.world_mut().get_mut::<Camera>(camera).expect("a camera").is_active = true;
    app.update(); // the camera's new place
    app.world_mut().spawn(Screenshot::image(target.clone())).observe(save_to_disk(path.to_path_buf()));
    until(app, "a picture is drawn", |_| path.is_file());
    app.world_mut().get_mut::<Camera>(camera).expect("a camera").is_active = false;
    app.insert_resource(step);
}

fn vertices(app: &App, garment: Entity) -> Vec<[f32; 3]> {
    let mesh = app.world().get::<Mesh3d>(garment).and_then(|mesh| app.world().resource::<Assets<Mesh>>().get(&mesh.0));
    match mesh.and_then(|mesh| mesh.attribute(Mesh::ATTRIBUTE_POSITION)) {
        Some(VertexAttributeValues::Float32x3(values)) => values.clone(),
        _ => fail("the garment has no mesh"),
    }
}

#[derive(Default)]
struct Recorded {
    names: Vec<String>,
    frames: usize,
    matrices: Vec<f32>,
    vertices: Vec<f32>,
}

impl Recorded {
    fn add(&mut self, app: &App, joints: &[Entity], vertices: &[[f32; 3]]) {
        self.names = joints.iter().map(|joint| app.world().get::<Name>(*joint).expect("a name").to_string()).collect();
        for joint in joints {
            let matrix = app.world().get::<GlobalTransform>(*joint).expect("a joint").to_matrix();
            self.matrices.extend(matrix.transpose().to_cols_array()); // row after row
        }
        self.vertices.extend(vertices.iter().flatten());
        self.frames += 1;
    }

    fn write(&self, folder: &Path) {
        let metadata = BTreeMap::from([
            ("fps", FPS.to_string()),
            ("joint_names", serde_json::to_string(&self.names).expect("names are JSON")),
        ]);
        let (frames, joints) = (self.frames, self.names.len());
        let tensor = ("joint_matrices", vec![frames, joints, 4, 4], self.matrices.clone());
        SafeTensors::write(&folder.join("poses.safetensors"), &metadata, &[tensor]);
        let tensor = ("positions", vec![frames, self.vertices.len() / (3 * frames), 3], self.vertices.clone());
        SafeTensors::write(&folder.join("vertices.safetensors"), &metadata, &[tensor]);
    }
}
