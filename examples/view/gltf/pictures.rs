//! Textures that a file brings.

use std::collections::BTreeMap;
use std::sync::Arc;

use gltf::json::{self, Index};
use image::RgbaImage;

use super::file::File;
use super::geometry::Material;
use crate::pictures;

/// Textures by UDIM number: colours and normals.
pub type OfTiles = BTreeMap<u32, [Option<Arc<RgbaImage>>; 2]>;

/// The UDIM number of a material's tile.
pub fn udim(place: usize) -> u32 {
    1001 + place as u32
}

/// Reads the textures of materials. One that cannot be read is left out, with the reason.
pub fn read(file: &mut File, materials: &[Material]) -> (OfTiles, Option<String>) {
    let (mut known, mut failed) = (BTreeMap::new(), None);
    let mut picture = |image: Option<Index<json::Image>>| {
        let image = image?;
        let read = known.entry(image.value()).or_insert_with(|| {
            let read = decode(file, image).map_err(|reason| format!("image {}: {reason}", image.value()));
            read.map_err(|reason| failed.get_or_insert(reason).clone()).ok().map(Arc::new)
        });
        read.clone()
    };
    let of_material = |(place, material): (usize, &Material)| {
        (udim(place), [picture(material.colour), picture(material.normal)])
    };
    (materials.iter().enumerate().map(of_material).collect(), failed)
}

fn decode(file: &mut File, index: Index<json::Image>) -> Result<RgbaImage, String> {
    let image = file.root.get(index).ok_or("is missing")?;
    let (view, uri) = (image.buffer_view, image.uri.clone());
    let decoded = match (view, uri) {
        (Some(view), _) => image::load_from_memory(file.view(view)?),
        (None, Some(uri)) => image::load_from_memory(&file.resource(&uri)?),
        (None, None) => return Err("has no data".into()),
    };
    decoded.map(pictures::prepared).map_err(|error| error.to_string())
}
