//! Encodes EXR and PNG files that describe their own content.

use std::io::Cursor;

use exr::error::Result as ExrResult;
use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer, LayerAttributes, SmallVec, WritableImage,
};

use crate::draw::palette::Indexed;
use crate::maps::Field;
use crate::overwrite::{EXR_MARK, PNG_MARK};

/// The description of a map's content.
#[derive(Debug)]
pub struct Facts<'a> {
    pub kind: &'a str,
    pub udim: u32,
    pub frame: usize,
    /// A hash of all inputs of the content.
    pub inputs: String,
}

impl Facts<'_> {
    /// As attributes. Blender reads the colour space from `colorInteropID`, OpenImageIO from `colorInteropID` and
    /// `oiio:ColorSpace`, so both are set. Chromaticities are left out: a program that reads them would convert the UVs
    /// as colours. The wrap mode asks for clamped edges.
    fn attributes(&self) -> LayerAttributes {
        let text = |text: &str| AttributeValue::Text(Text::from(text));
        let other = [
            ("colorInteropID", text("data")),
            ("oiio:ColorSpace", text("data")),
            ("vrtm:kind", text(self.kind)),
            ("vrtm:form", text("tile")),
            ("vrtm:udim", AttributeValue::I32(self.udim as i32)),
            ("vrtm:frame", AttributeValue::I32(self.frame as i32)),
            ("vrtm:version", text(env!("CARGO_PKG_VERSION"))),
            (EXR_MARK, text(&self.inputs)),
        ];
        LayerAttributes {
            software_name: Some(concat!("vrtm ", env!("CARGO_PKG_VERSION")).into()),
            wrap_mode_name: Some("clamp".into()),
            other: other.map(|(name, value)| (Text::from(name), value)).into_iter().collect(),
            ..LayerAttributes::default()
        }
    }
}

/// An EXR file with lossless compression (ZIP).
pub fn exr(image: &Field<3>, facts: &Facts) -> ExrResult<Vec<u8>> {
    let channel = |(k, name)| {
        AnyChannel::new(name, FlatSamples::F32(image.data.iter().map(|texel: &[f32; 3]| texel[k]).collect()))
    };
    let channels: SmallVec<[_; 4]> = ["R", "G", "B"].into_iter().enumerate().map(channel).collect();
    let size = (image.size[0], image.size[1]);
    let layer = Layer::new(size, facts.attributes(), Encoding::SMALL_LOSSLESS, AnyChannels::sort(channels));
    let mut bytes = Cursor::new(Vec::new());
    Image::from_layer(layer).write().to_buffered(&mut bytes)?;
    let mut bytes = bytes.into_inner();
    sort_attributes(&mut bytes);
    Ok(bytes)
}

/// Sorts the attributes in a file's header by name. The crate `exr` writes them in an order that changes from run to
/// run, but the same inputs should give the same bytes. A header is a list of names, types and sizes, each followed by
/// a value, and ends with an empty name.
fn sort_attributes(bytes: &mut [u8]) {
    const MAGIC_AND_VERSION: usize = 8;
    let mut attributes: Vec<Vec<u8>> = Vec::new();
    let mut rest = &bytes[MAGIC_AND_VERSION..];
    let text_end = |rest: &[u8], from: usize| from + rest[from..].iter().take_while(|&&b| b != 0).count() + 1;
    while rest[0] != 0 {
        let size_at = text_end(rest, text_end(rest, 0));
        let size = [0, 1, 2, 3].map(|k| rest[size_at + k]);
        let end = size_at + 4 + u32::from_le_bytes(size) as usize;
        attributes.push(rest[..end].to_vec());
        rest = &rest[end..];
    }
    attributes.sort();
    let sorted = attributes.concat();
    bytes[MAGIC_AND_VERSION..MAGIC_AND_VERSION + sorted.len()].copy_from_slice(&sorted);
}

/// A PNG file with the mark of vrtm.
pub fn png(image: &image::RgbImage) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = marked(&mut bytes, "sheet", image.dimensions().into())?;
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.as_raw())?;
    writer.finish()?;
    Ok(bytes)
}

/// An animated PNG file with the mark of vrtm, which repeats without end.
pub fn film(film: &Indexed, duration: (u16, u16)) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = marked(&mut bytes, "film", film.size)?;
    encoder.set_color(png::ColorType::Indexed);
    encoder.set_palette(film.palette.as_slice());
    encoder.set_compression(png::Compression::High);
    // Neighbouring indices are no neighbouring colours.
    encoder.set_filter(png::Filter::NoFilter);
    encoder.set_animated(film.pictures.len() as u32, 0)?;
    encoder.set_frame_delay(duration.0, duration.1)?;
    let mut writer = encoder.write_header()?;
    for picture in &film.pictures {
        writer.write_image_data(picture)?;
    }
    writer.finish()?;
    Ok(bytes)
}

fn marked<'a>(
    bytes: &'a mut Vec<u8>,
    kind: &str,
    [width, height]: [u32; 2],
) -> Result<png::Encoder<'a, &'a mut Vec<u8>>, png::EncodingError> {
    let mut encoder = png::Encoder::new(bytes, width, height);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.add_text_chunk(PNG_MARK.into(), kind.into())?;
    Ok(encoder)
}
