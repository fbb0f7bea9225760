//! Encodes EXR and PNG files.

use std::collections::HashMap;
use std::io::Cursor;

use color_quant::NeuQuant;
use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, WritableImage,
};
use image::RgbImage;

use crate::field::Field;

/// An EXR file with lossless compression (ZIP). Blender reads the colour space from `colorInteropID`, OpenImageIO from
/// `oiio:ColorSpace`, too. Chromaticities are left out: a program that reads them would convert the UVs as colours.
pub fn exr(image: &Field<3>) -> exr::error::Result<Vec<u8>> {
    let data = |name: &str| (Text::from(name), AttributeValue::Text(Text::from("data")));
    let attributes = LayerAttributes {
        wrap_mode_name: Some("clamp".into()),
        other: ["colorInteropID", "oiio:ColorSpace"].map(data).into_iter().collect(),
        ..LayerAttributes::default()
    };
    let channel = |(k, name)| {
        AnyChannel::new(name, FlatSamples::F32(image.data.iter().map(|texel: &[f32; 3]| texel[k]).collect()))
    };
    let channels: SmallVec<[_; 4]> = ["R", "G", "B"].into_iter().enumerate().map(channel).collect();
    let size = (image.size[0], image.size[1]);
    let layer = Layer::new(size, attributes, Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes)?;
    Ok(bytes.into_inner())
}

/// A PNG file.
pub fn png(image: &RgbImage) -> image::ImageResult<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png)?;
    Ok(bytes.into_inner())
}

/// Colours of a film. With more the pictures' shades are smoother, and the file is larger.
const COLOURS: usize = 128;
/// One of so many pixels counts for the choice of the colours.
const SAMPLES: i32 = 10;

/// An animated PNG file of pictures with a common palette, which repeats without end. A picture lasts a fraction of a
/// second.
pub fn film(pictures: &[RgbImage], duration: (u16, u16)) -> Result<Vec<u8>, png::EncodingError> {
    let opaque = |&image::Rgb([r, g, b]): &image::Rgb<u8>| [r, g, b, 255];
    let few = pictures.iter().step_by(6).flat_map(|picture| picture.pixels().map(opaque));
    let quantiser = NeuQuant::new(SAMPLES, COLOURS, few.collect::<Vec<_>>().as_flattened());
    let (width, height) = pictures[0].dimensions();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(quantiser.color_map_rgb());
    encoder.set_compression(png::Compression::High);
    // Neighbouring indices are no neighbouring colours.
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_animated(pictures.len() as u32, 0)?;
    encoder.set_frame_delay(duration.0, duration.1)?;
    let mut writer = encoder.write_header()?;
    let mut known = HashMap::new();
    for picture in pictures {
        let index =
            |colour: [u8; 4]| *known.entry(colour).or_insert_with(|| quantiser.index_of(&colour) as u8);
        writer.write_image_data(&picture.pixels().map(opaque).map(index).collect::<Vec<_>>())?;
    }
    writer.finish()?;
    Ok(bytes)
}
