use bevy::asset::io::Reader;
use bevy::asset::{Asset, AssetLoader, LoadContext};
use bevy::reflect::TypePath;

/// A garment as an asset: what `asset_server.load("skirt.dcloth")` gives.
#[derive(Asset, TypePath, Clone, Debug)]
pub struct ClothModel(pub dcloth::Model);

/// Reads and checks `.dcloth` files.
#[derive(TypePath, Default)]
pub struct ClothLoader;

impl AssetLoader for ClothLoader {
    type Asset = ClothModel;
    type Settings = ();
    type Error = Box<dyn std::error::Error + Send + Sync>;

    async fn load(
        &self,
        reader: &mut dyn Reader,
        _settings: &(),
        _context: &mut LoadContext<'_>,
    ) -> Result<ClothModel, Self::Error> {
        let mut bytes = Vec::new();
        reader.read_to_end(&mut bytes).await?;
        Ok(ClothModel(dcloth::Model::open(&bytes)?))
    }

    fn extensions(&self) -> &[&str] {
        &["dcloth"]
    }
}
