//! PNG in memory.

/// A picture of 4 bytes per pixel, written without the fourth: a picture of the window is opaque.
///
/// # Errors
/// Those of the encoder.
pub fn picture(size: [u32; 2], pixels: &[u8]) -> Result<Vec<u8>, String> {
    encode(size, png::ColorType::Rgb, png::BitDepth::Eight, &opaque(pixels))
}

/// The first three of every four bytes.
pub fn opaque(pixels: &[u8]) -> Vec<u8> {
    pixels.chunks_exact(4).flat_map(|pixel| &pixel[..3]).copied().collect()
}

/// A grey image; the bytes of 16-bit values begin with the higher one.
///
/// # Errors
/// Those of the encoder.
pub fn grey(size: [u32; 2], depth: png::BitDepth, bytes: &[u8]) -> Result<Vec<u8>, String> {
    encode(size, png::ColorType::Grayscale, depth, bytes)
}

fn encode(
    [width, height]: [u32; 2],
    colour: png::ColorType,
    depth: png::BitDepth,
    bytes: &[u8],
) -> Result<Vec<u8>, String> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    let mut writer = encoder.write_header().map_err(|error| error.to_string())?;
    writer.write_image_data(bytes).map_err(|error| error.to_string())?;
    writer.finish().map_err(|error| error.to_string())?;
    Ok(file)
}
