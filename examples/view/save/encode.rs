//! PNG in memory.

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError};

/// An image of this kind; values of 16 bits are those of the machine.
///
/// # Errors
/// Those of the encoder.
pub fn encode(
    [width, height]: [u32; 2],
    kind: ExtendedColorType,
    bytes: &[u8],
) -> Result<Vec<u8>, ImageError> {
    let mut file = Vec::new();
    PngEncoder::new(&mut file).write_image(bytes, width, height, kind)?;
    Ok(file)
}
