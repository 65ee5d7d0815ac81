#![doc = include_str!("../README.md")]
#![deny(missing_docs)]

mod character;
mod cloth;
mod error;
mod ffi;
mod frame;
mod library;
mod memory;
mod model;
mod output;
mod pose;

pub use character::{Body, Character, Fit, FitWarning, Role};
pub use cloth::{Cloth, ClothInfo};
pub use error::{Error, Status};
pub use frame::Frame;
pub use library::{isa_name, select_isa, version};
pub use model::{Model, Parent, Stages, Texture};
pub use output::Output;
pub use pose::{Axis, Pose, Space};
