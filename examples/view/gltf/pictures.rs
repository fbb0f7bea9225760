//! Textures that a file brings.

use std::collections::BTreeMap;
use std::sync::Arc;

use eframe::egui::ecolor::{gamma_u8_from_linear_f32, linear_f32_from_gamma_u8};
use gltf::json::{self, Index};
use image::{Rgba, RgbaImage};

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
        (udim(place), [coloured(picture(material.colour), material), picture(material.normal)])
    };
    (materials.iter().enumerate().map(of_material).collect(), failed)
}

/// A texture by the factors of its material; without an image, one of its colour, unless that is white.
fn coloured(image: Option<Arc<RgbaImage>>, material: &Material) -> Option<Arc<RgbaImage>> {
    let &Material { factor, cutoff, colour, .. } = material;
    let is_plain = factor == [1.0; 4];
    let mut image = match image {
        None if is_plain || colour.is_some() => return None,
        None => RgbaImage::from_pixel(2, 2, Rgba([255; 4])).into(),
        Some(image) if is_plain && image.pixels().all(|pixel| pixel.0[3] == 255) => return Some(image),
        Some(image) => image,
    };
    let by = |factor: f32| -> [u8; 256] {
        std::array::from_fn(|k| gamma_u8_from_linear_f32(factor * linear_f32_from_gamma_u8(k as u8)))
    };
    let [red, green, blue] = [0, 1, 2].map(|c| by(factor[c]));
    for Rgba([r, g, b, a]) in Arc::make_mut(&mut image).pixels_mut() {
        [*r, *g, *b] = [red[*r as usize], green[*g as usize], blue[*b as usize]];
        let alpha = factor[3] * f32::from(*a);
        *a = cutoff.map_or(alpha, |cutoff| if alpha >= 255.0 * cutoff { 255.0 } else { 0.0 }) as u8;
    }
    Some(image)
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
