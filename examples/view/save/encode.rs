//! PNG in memory.

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder, ImageError};

/// A picture of 4 bytes per pixel, written without the fourth: a picture of the window is opaque.
///
/// # Errors
/// Those of the encoder.
pub fn picture(size: [u32; 2], pixels: &[u8]) -> Result<Vec<u8>, ImageError> {
    encode(size, ExtendedColorType::Rgb8, &opaque(pixels))
}

/// The first three of every four bytes.
pub fn opaque(pixels: &[u8]) -> Vec<u8> {
    pixels.chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect()
}

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
