//! Textures of the tiles, colours and normal maps: image files as a GPU takes them.

use std::path::Path;
use std::sync::Arc;

use image::imageops::FilterType;
use image::{DynamicImage, RgbaImage, imageops};

/// Most texels on a side: what every GPU that draws a window has.
const LARGEST: u32 = 8192;

/// The texture of each tile; `None` if it has none.
pub type Textures = Vec<Option<Arc<RgbaImage>>>;

/// Textures and maps of a drawn mesh.
#[derive(Clone, Default)]
pub struct Pictures {
    pub colours: Textures,
    /// Normals in tangent space; green grows with v.
    pub normals: Textures,
}

impl Pictures {
    pub fn none(pages: usize) -> Pictures {
        Pictures { colours: vec![None; pages], normals: vec![None; pages] }
    }

    /// True if a page has a colour texture.
    pub fn have_colour(&self) -> bool {
        self.colours.iter().any(Option::is_some)
    }
}

/// Reads the texture of a tile; `None` if the tile has none. In the path `<UDIM>` stands for the tile's number.
pub fn read(path: &str, udim: u32) -> Result<Option<RgbaImage>, String> {
    let path = path.replace("<UDIM>", &udim.to_string());
    if !Path::new(&path).exists() {
        return Ok(None);
    }
    let image = image::open(&path).map_err(|error| format!("{path}: {error}"))?;
    // What files keep in a fourth channel is rarely the surface's opacity.
    Ok(Some(prepared(image.into_rgb8().into())))
}

/// An image as a GPU's texture takes it: its first row is at v = 0.
pub fn prepared(image: DynamicImage) -> RgbaImage {
    let mut image = at_most(LARGEST, image.into_rgba8());
    // A single texel would stand for none.
    if image.width() == 1 {
        image = imageops::resize(&image, 2, image.height(), FilterType::Nearest);
    }
    imageops::flip_vertical_in_place(&mut image);
    image
}

/// An image with no more texels on a side.
pub fn at_most(most: u32, image: RgbaImage) -> RgbaImage {
    let larger = image.width().max(image.height());
    if larger <= most {
        return image;
    }
    let [width, height] = [image.width(), image.height()].map(|side| (side * most / larger).max(1));
    imageops::resize(&image, width, height, FilterType::Triangle)
}
