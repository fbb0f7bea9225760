//! Saving: rigidity maps, a picture. A file is there as a whole or not at all.

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError};

pub mod file;
pub mod rigidity;

/// A PNG in memory; values of 16 bits are those of the machine.
pub fn encode(
    [width, height]: [u32; 2],
    kind: ExtendedColorType,
    bytes: &[u8],
) -> Result<Vec<u8>, ImageError> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(bytes, width, height, kind)?;
    Ok(file)
}
