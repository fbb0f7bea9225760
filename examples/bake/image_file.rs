//! Reads maps of one channel from image files: PNG, JPEG, TIFF and EXR, in the precision that they are stored in.

use std::io::Cursor;
use std::path::Path;

use exr::prelude::{FlatSamples, ReadChannels as _, ReadLayers as _, f16};
use image::{DynamicImage, ImageFormat, ImageReader};
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingResult};
use vrtm::PixelFormat;

use crate::failure::{Failure, Result, read};
use crate::maps::Map;

/// Texels, packed, first row at the top.
type Texels = (u32, u32, PixelFormat, Vec<u8>);

/// The first bytes of every EXR file.
pub const EXR: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// Reads a map. Of a colour image it takes the luminance, which of a grey one is the value itself.
pub fn load(path: &Path) -> Result<Map> {
    let bytes = read(path)?;
    let decoded = if bytes.starts_with(&EXR) { decode_exr(&bytes) } else { decode(bytes) };
    let (width, height, format, bytes) = decoded.map_err(|reason| Failure::file(path, reason))?;
    Ok(Map { width, height, format, bytes, origin: path.display().to_string() })
}

fn decode(bytes: Vec<u8>) -> std::result::Result<Texels, String> {
    let reader = ImageReader::new(Cursor::new(&bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    if reader.format() == Some(ImageFormat::Tiff)
        && let Some(texels) = decode_grey_tiff(&bytes)?
    {
        return Ok(texels);
    }
    let image = reader.decode().map_err(|e| e.to_string())?;
    let (width, height) = (image.width(), image.height());
    let (format, bytes) = match image {
        DynamicImage::ImageLuma8(_)
        | DynamicImage::ImageLumaA8(_)
        | DynamicImage::ImageRgb8(_)
        | DynamicImage::ImageRgba8(_) => (PixelFormat::U8, image.into_luma8().into_raw()),
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let colours = image.into_rgb32f().into_raw();
            let texels = colours.chunks_exact(3).map(|c| luminance([c[0], c[1], c[2]]));
            (PixelFormat::F32, texels.flat_map(f32::to_ne_bytes).collect())
        }
        deep => {
            let texels = deep.into_luma16().into_raw();
            (PixelFormat::U16, texels.into_iter().flat_map(u16::to_ne_bytes).collect())
        }
    };
    Ok((width, height, format, bytes))
}

/// A TIFF with one channel of 16 bits or more, floating-point numbers among them, which the crate `image` does not read;
/// `None` for others.
fn decode_grey_tiff(bytes: &[u8]) -> std::result::Result<Option<Texels>, String> {
    let read = || -> tiff::TiffResult<Option<Texels>> {
        let mut decoder = Decoder::new(Cursor::new(bytes))?;
        let (width, height) = decoder.dimensions()?;
        if !matches!(decoder.colortype()?, ColorType::Gray(16 | 32 | 64)) {
            return Ok(None);
        }
        let (format, bytes) = match decoder.read_image()? {
            DecodingResult::U16(t) => (PixelFormat::U16, t.into_iter().flat_map(u16::to_ne_bytes).collect()),
            DecodingResult::F16(t) => (PixelFormat::F16, t.into_iter().flat_map(f16::to_ne_bytes).collect()),
            DecodingResult::F32(t) => (PixelFormat::F32, t.into_iter().flat_map(f32::to_ne_bytes).collect()),
            DecodingResult::F64(t) => {
                (PixelFormat::F32, t.into_iter().flat_map(|x| (x as f32).to_ne_bytes()).collect())
            }
            DecodingResult::U32(t) => {
                let share = |x: u32| (f64::from(x) / f64::from(u32::MAX)) as f32;
                (PixelFormat::F32, t.into_iter().flat_map(|x| share(x).to_ne_bytes()).collect())
            }
            _ => return Ok(None),
        };
        Ok(Some((width, height, format, bytes)))
    };
    read().map_err(|e| e.to_string())
}

/// Takes a file's only channel, whatever its name, or Y, or the luminance of R, G and B, or R. What lies outside of its
/// data window is 0.
fn decode_exr(bytes: &[u8]) -> std::result::Result<Texels, String> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(Cursor::new(bytes))
        .map_err(|e| e.to_string())?;
    let layer = &image.layer_data;
    let channels = &layer.channel_data.list;
    // The last part of a name such as `rigidity.R`.
    let named = |wanted: &str| {
        channels.iter().find(|c| c.name.to_string().rsplit('.').next().is_some_and(|name| name == wanted))
    };
    let one = if let [only] = channels.as_slice() { Some(only) } else { named("Y") };
    let (format, texels) = match (one, named("R"), named("G"), named("B")) {
        (Some(one), ..) => stored(&one.sample_data),
        (None, Some(r), Some(g), Some(b)) => {
            let [r, g, b] = [r, g, b].map(|c| c.sample_data.values_as_f32().collect::<Vec<_>>());
            let texels = r.iter().zip(&g).zip(&b).map(|((&r, &g), &b)| luminance([r, g, b]));
            (PixelFormat::F32, texels.flat_map(f32::to_ne_bytes).collect())
        }
        (None, Some(r), ..) => stored(&r.sample_data),
        _ => {
            let names: Vec<String> = channels.iter().map(|c| format!("'{}'", c.name)).collect();
            return Err(format!("none of its channels {} is named Y or R", names.join(", ")));
        }
    };
    let size = layer.size;
    let bytes_each = if format == PixelFormat::F16 { 2 } else { 4 };
    if texels.len() != size.area() * bytes_each {
        return Err("its channels are subsampled".into());
    }
    let window = image.attributes.display_window;
    let first = layer.attributes.layer_position - window.position;
    if (first.x(), first.y()) == (0, 0) && size == window.size {
        return Ok((size.x() as u32, size.y() as u32, format, texels));
    }
    let mut whole = vec![0; window.size.area() * bytes_each];
    for y in 0..size.y() {
        for x in 0..size.x() {
            let at = [first.x() as i64 + x as i64, first.y() as i64 + y as i64];
            if (0..window.size.x() as i64).contains(&at[0]) && (0..window.size.y() as i64).contains(&at[1]) {
                let to = (at[1] as usize * window.size.x() + at[0] as usize) * bytes_each;
                let from = (y * size.x() + x) * bytes_each;
                whole[to..to + bytes_each].copy_from_slice(&texels[from..from + bytes_each]);
            }
        }
    }
    Ok((window.size.x() as u32, window.size.y() as u32, format, whole))
}

/// A channel as it is stored; integers, which EXR has for identifiers, become floating-point numbers.
fn stored(samples: &FlatSamples) -> (PixelFormat, Vec<u8>) {
    match samples {
        FlatSamples::F16(values) => (PixelFormat::F16, values.iter().flat_map(|x| x.to_ne_bytes()).collect()),
        FlatSamples::F32(values) => (PixelFormat::F32, values.iter().flat_map(|x| x.to_ne_bytes()).collect()),
        FlatSamples::U32(values) => {
            (PixelFormat::F32, values.iter().flat_map(|&x| (x as f32).to_ne_bytes()).collect())
        }
    }
}

/// Of a linear colour; exactly the value of a grey one.
pub fn luminance([r, g, b]: [f32; 3]) -> f32 {
    if r == g && g == b { r } else { 0.2126 * r + 0.7152 * g + 0.0722 * b }
}
