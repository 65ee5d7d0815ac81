//! What the example `pictures` drew. `scripts/test_rust.sh` runs it, and puts its files and what `dcloth run` draws of
//! the same poses into DCLOTH_RUST_DATA/pictures.
use std::path::PathBuf;

use bevy::asset::RenderAssetUsages;
use bevy::image::{CompressedImageFormats, Image, ImageSampler, ImageType};

#[path = "../../dcloth/tests/common/safetensors.rs"]
mod safetensors;
use safetensors::SafeTensors;

const ALLOWED_MM: f64 = 0.01;

fn folder() -> PathBuf {
    let data = std::env::var_os("DCLOTH_RUST_DATA").expect("DCLOTH_RUST_DATA; scripts/test_rust.sh sets it");
    PathBuf::from(data).join("pictures")
}

#[test]
#[ignore = "needs what the example has drawn; scripts/test_rust.sh pictures runs it"]
fn vertices_are_those_of_the_c_host() {
    let [drawn, expected] =
        ["vertices.safetensors", "run.safetensors"].map(|name| SafeTensors::read(folder().join(name)));
    let shape = drawn.shape("positions");
    assert!(shape[0] > 100 && shape == expected.shape("positions"), "{shape:?}");
    let (drawn, expected) = (drawn.f32::<3>("positions"), expected.f32::<3>("positions"));
    let mut worst: f64 = 0.0;
    for (a, b) in drawn.iter().zip(&expected) {
        assert!(a.iter().chain(b).all(|value| value.is_finite()));
        worst = worst.max(1000.0 * (0..3).map(|i| f64::from(a[i] - b[i]).powi(2)).sum::<f64>().sqrt());
    }
    println!("drawn by Bevy: {} frames, largest distance of a vertex {worst:.6} mm", shape[0]);
    assert!(worst <= ALLOWED_MM, "{worst} mm");
}

/// The skirt is the one thing that is red: it takes its share of each picture, in the middle, and moves.
#[test]
#[ignore = "needs what the example has drawn; scripts/test_rust.sh pictures runs it"]
fn pictures_show_the_skirt() {
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder())
        .expect("pictures")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "png"))
        .collect();
    paths.sort();
    assert!(paths.len() >= 4, "{} pictures", paths.len());
    let reds: Vec<Vec<bool>> = paths
        .iter()
        .map(|path| {
            let bytes = std::fs::read(path).expect("a picture");
            let kind = ImageType::Extension("png");
            let usage = RenderAssetUsages::MAIN_WORLD;
            let image =
                Image::from_buffer(&bytes, kind, CompressedImageFormats::NONE, true, ImageSampler::Default, usage);
            let image = image.expect("a PNG file");
            let width = image.width() as usize;
            let pixels = image.data.as_ref().expect("pixels").chunks_exact(4);
            let red: Vec<bool> = pixels
                .map(|p| u32::from(p[0]) > 2 * u32::from(p[1]) && u32::from(p[0]) > 2 * u32::from(p[2]) && p[0] > 40)
                .collect();
            let at: Vec<(usize, usize)> =
                red.iter().enumerate().filter(|(_, red)| **red).map(|(i, _)| (i % width, i / width)).collect();
            let share = at.len() as f64 / red.len() as f64;
            assert!((0.01..0.3).contains(&share), "{}: {share} of the picture is red", path.display());
            let mean = |of: fn(&(usize, usize)) -> usize| at.iter().map(of).sum::<usize>() as f64 / at.len() as f64;
            for middle in [mean(|p| p.0) / width as f64, mean(|p| p.1) / f64::from(image.height())] {
                assert!((0.25..0.75).contains(&middle), "{}: the skirt is at {middle}", path.display());
            }
            red
        })
        .collect();
    for pair in reds.windows(2) {
        let changed = pair[0].iter().zip(&pair[1]).filter(|(a, b)| a != b).count() as f64 / pair[0].len() as f64;
        assert!(changed > 0.003, "{changed}");
    }
}
