//! Links the engine: the one in `DCLOTH_LIB_DIR`, or one that is built from the repository around this crate.
use std::env;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo:rerun-if-env-changed=DCLOTH_LIB_DIR");
    println!("cargo:rerun-if-env-changed=DOCS_RS");
    println!("cargo:rerun-if-changed=build.rs");
    if env::var_os("DOCS_RS").is_some() {
        return;
    }
    match env::var_os("DCLOTH_LIB_DIR") {
        Some(folder) => {
            link("dcloth_fit", Path::new(&folder), "DCLOTH_LIB_DIR");
            link("dcloth", Path::new(&folder), "DCLOTH_LIB_DIR");
        }
        None => {
            let built = build();
            link("dcloth_fit", &library_folder(&built.join("fit")), "the build of the repository");
            link("dcloth", &library_folder(&built.join("engine")), "the build of the repository");
        }
    }
    if env::var("CARGO_CFG_TARGET_FAMILY").is_ok_and(|family| family == "unix") {
        println!("cargo:rustc-link-lib=m");
    }
}

/// Builds the static libraries and returns the folder of the build.
fn build() -> PathBuf {
    let crate_folder = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR"));
    let repository = crate_folder.join("../../..");
    if !repository.join("engine/include/dcloth/dcloth.h").is_file() {
        panic!(
            "dcloth: found no sources of the engine at {}; allowed: this crate inside a clone of the repository, or \
             DCLOTH_LIB_DIR with the folder of a built library",
            repository.display()
        );
    }
    for part in ["CMakeLists.txt", "cmake", "engine", "fit", "kernels"] {
        println!("cargo:rerun-if-changed={}", repository.join(part).display());
    }
    let built = cmake::Config::new(&repository)
        .profile("Release")
        .define("BUILD_SHARED_LIBS", "OFF")
        .define("DCLOTH_BUILD_TOOLS", "OFF")
        .define("DCLOTH_BUILD_MAPPED_FILE", "OFF")
        .define("DCLOTH_BUILD_TESTS", "OFF")
        .define("DCLOTH_BUILD_CLOTH_SOLVER", "OFF")
        .build_target("dcloth_fit")
        .build();
    built.join("build")
}

/// Generators with many configurations put libraries into a folder more.
fn library_folder(folder: &Path) -> PathBuf {
    let release = folder.join("Release");
    if release.is_dir() { release } else { folder.into() }
}

fn link(library: &str, folder: &Path, from: &str) {
    let holds = |names: &[String]| names.iter().any(|name| folder.join(name).is_file());
    let kind = if holds(&[format!("lib{library}.a"), format!("{library}.lib")]) {
        "static"
    } else if holds(&[format!("lib{library}.so"), format!("lib{library}.dylib"), format!("{library}.dll")]) {
        "dylib"
    } else {
        panic!(
            "dcloth: found no library {library} in {} ({from}); allowed: a folder with lib{library}.a, \
             lib{library}.so, lib{library}.dylib or {library}.lib",
            folder.display()
        );
    };
    println!("cargo:rustc-link-search=native={}", folder.display());
    println!("cargo:rustc-link-lib={kind}={library}");
}
