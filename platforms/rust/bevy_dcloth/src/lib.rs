#![doc = include_str!("../README.md")]
#![deny(missing_docs)]

mod dress;
mod garment;
mod loader;

use bevy::app::{App, Plugin, PostUpdate};
use bevy::asset::{AssetApp, AssetEventSystems};
use bevy::ecs::schedule::{IntoScheduleConfigs, SystemSet};
use bevy::transform::TransformSystems;

pub use dcloth;
pub use garment::{Garment, GarmentFit, GarmentState};
pub use loader::{ClothLoader, ClothModel};

/// Loads `.dcloth` files and updates every [`Garment`] in [`PostUpdate`], after transforms were propagated.
pub struct DclothPlugin;

/// When garments are dressed and updated: in [`PostUpdate`], after [`TransformSystems::Propagate`].
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GarmentSystems;

impl Plugin for DclothPlugin {
    fn build(&self, app: &mut App) {
        app.init_asset::<ClothModel>()
            .register_asset_loader(ClothLoader)
            .add_systems(PostUpdate, (dress::dress, garment::update, garment::show).chain().in_set(GarmentSystems));
        // Renderer and bounds hear of new vertices in the same frame.
        app.configure_sets(PostUpdate, GarmentSystems.after(TransformSystems::Propagate).before(AssetEventSystems));
    }
}
