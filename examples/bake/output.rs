//! Writes files so that they appear complete or not at all: each gets a temporary name, and a frame's files are renamed
//! together, once the disk has them.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{Cursor, ErrorKind, Write};
use std::path::{Path, PathBuf};

use exr::meta::attribute::{AttributeValue, Text};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, Layer, LayerAttributes, SmallVec,
    WritableImage, f16,
};
use vrtm::PixelFormat;

use crate::failure::{Failure, Result};
use crate::outputs::{Image, Output};
use crate::overwrite::{self, EXR_MARK, PNG_MARK};
use crate::signals::Unfinished;

/// What a file tells of itself.
#[derive(Debug)]
pub struct Facts {
    pub output: Output,
    pub udim: u32,
    pub frame: usize,
    /// A hash of all that the content depends on.
    pub inputs: String,
}

impl Facts {
    /// As attributes. Blender takes `colorInteropID` for the colour space, OpenImageIO this and `oiio:ColorSpace`; both are
    /// set, and no chromaticities: a program that reads those converts what it takes for a colour. The edges are clamped
    /// where the wrap mode is read.
    fn attributes(&self) -> LayerAttributes {
        let text = |text: &str| AttributeValue::Text(Text::from(text));
        let mut attributes = LayerAttributes {
            software_name: Some(concat!("vrtm ", env!("CARGO_PKG_VERSION")).into()),
            wrap_mode_name: Some("clamp".into()),
            ..LayerAttributes::default()
        };
        for (name, value) in [
            ("colorInteropID", text("data")),
            ("oiio:ColorSpace", text("data")),
            ("vrtm:kind", text(self.output.kind)),
            ("vrtm:udim", AttributeValue::I32(self.udim as i32)),
            ("vrtm:frame", AttributeValue::I32(self.frame as i32)),
            ("vrtm:version", text(env!("CARGO_PKG_VERSION"))),
            (EXR_MARK, text(&self.inputs)),
        ] {
            attributes.other.insert(name.into(), value);
        }
        if let Some(form) = self.output.form {
            attributes.other.insert("vrtm:form".into(), text(form));
        }
        attributes
    }
}

/// Files to be renamed. If it is dropped without [`Staging::commit`], or a signal ends the program, they are removed.
#[derive(Debug)]
pub struct Staging {
    folder: PathBuf,
    waiting: Unfinished,
    /// Files that have not been written yet, out of those that may be.
    planned: BTreeSet<PathBuf>,
}

impl Staging {
    /// Makes the folder if it does not exist. `planned` are the files that [`overwrite::check`] has passed.
    pub fn new(folder: &Path, planned: Vec<PathBuf>, waiting: Unfinished) -> Result<Staging> {
        fs::create_dir_all(folder).map_err(|e| Failure::file(folder, e))?;
        Ok(Staging { folder: folder.into(), waiting, planned: planned.into_iter().collect() })
    }

    /// Writes a whole file, which waits for its name.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        let path = self.folder.join(name);
        assert!(self.planned.contains(&path), "{} may be somebody's file", path.display());
        let failure = |e| Failure::file(&path, e);
        // Beside the file, so that it can be renamed.
        let (folder, file) = (path.parent().unwrap_or(&self.folder), path.file_name().unwrap_or_default());
        fs::create_dir_all(folder).map_err(|e| Failure::file(folder, e))?;
        // Both under one lock: a signal finds the file in the list, or it is not made at all.
        let mut waiting = self.waiting.lock();
        let mut number = std::process::id();
        let (temporary, mut file) = loop {
            let temporary = folder.join(format!(".{}.{number}.part", file.to_string_lossy()));
            match File::create_new(&temporary) {
                Ok(file) => break (temporary, file),
                // Of a program that was killed, or that has this number on another machine.
                Err(e) if e.kind() == ErrorKind::AlreadyExists => number = number.wrapping_add(1),
                Err(e) => return Err(failure(e)),
            }
        };
        waiting.push((temporary, path.clone()));
        drop(waiting);
        // A full disk is sometimes told only once it has to have all of the file.
        file.write_all(bytes).and_then(|()| file.sync_all()).map_err(failure)?;
        let length = file.metadata().map_err(failure)?.len();
        if length != bytes.len() as u64 {
            return Err(Failure::file(&path, format!("{length} of {} bytes were written", bytes.len())));
        }
        Ok(())
    }

    /// Writes an image with lossless compression (ZIP).
    pub fn exr(&mut self, name: &str, image: &Image, facts: &Facts) -> Result<()> {
        let bytes = encode_exr(image, facts).map_err(|e| Failure::named(name, e))?;
        self.write(name, &bytes)
    }

    /// Writes a frame's picture.
    pub fn png(&mut self, name: &str, image: &image::RgbImage) -> Result<()> {
        let bytes = encode_png(image).map_err(|e| Failure::named(name, e))?;
        self.write(name, &bytes)
    }

    /// Renames the files to their final names; a signal waits until all have theirs.
    pub fn commit(&mut self) -> Result<()> {
        let mut waiting = self.waiting.lock();
        for (temporary, path) in waiting.iter() {
            fs::rename(temporary, path).map_err(|e| Failure::file(path, e))?;
            self.planned.remove(path);
        }
        // The names are to outlast a crash, too. Windows sees to that itself, and not every file system can.
        #[cfg(unix)]
        for folder in waiting.iter().filter_map(|(_, path)| path.parent()).collect::<BTreeSet<_>>() {
            let _ = File::open(folder).and_then(|folder| folder.sync_all());
        }
        waiting.clear();
        Ok(())
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        Unfinished::remove(&mut self.waiting.lock());
        // What is left over after a failure may lie there damaged, from before: nobody is to take it for a result.
        self.planned.iter().for_each(|path| overwrite::remove_if_damaged(path));
    }
}

fn encode_png(image: &image::RgbImage) -> std::result::Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, image.width(), image.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.add_text_chunk(PNG_MARK.into(), "sheet".into())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(image.as_raw())?;
    writer.finish()?;
    Ok(bytes)
}

fn encode_exr(image: &Image, facts: &Facts) -> exr::error::Result<Vec<u8>> {
    let each = if image.format == PixelFormat::F16 { 2 } else { 4 };
    let channel = |(k, name): (usize, &&str)| {
        // An image of one channel fills all of the file's.
        let k = k.min(image.channels - 1);
        let values =
            image.bytes.chunks_exact(image.channels * each).map(|texel| &texel[k * each..(k + 1) * each]);
        let samples = if image.format == PixelFormat::F16 {
            FlatSamples::F16(values.map(|b| f16::from_ne_bytes([b[0], b[1]])).collect())
        } else {
            FlatSamples::F32(values.map(|b| f32::from_ne_bytes([b[0], b[1], b[2], b[3]])).collect())
        };
        AnyChannel::new(*name, samples)
    };
    let channels: SmallVec<[_; 4]> = image.names.iter().enumerate().map(channel).collect();
    let [width, height] = image.size.map(|n| n as usize);
    let layer = Layer::new(
        (width, height),
        facts.attributes(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(channels),
    );
    let mut bytes = Cursor::new(Vec::new());
    ExrImage::from_layer(layer).write().to_buffered(&mut bytes)?;
    let mut bytes = bytes.into_inner();
    sort_attributes(&mut bytes);
    Ok(bytes)
}

/// Sorts the attributes in a file's header by name. The crate `exr` writes them in an order that changes from run to run;
/// the same inputs are to give the same bytes. A header is a list of names, types and sizes, each followed by a value, and
/// ends with an empty name.
fn sort_attributes(bytes: &mut [u8]) {
    const MAGIC_AND_VERSION: usize = 8;
    let mut attributes: Vec<Vec<u8>> = Vec::new();
    let mut rest = &bytes[MAGIC_AND_VERSION..];
    let text_end =
        |bytes: &[u8], from: usize| from + bytes[from..].iter().take_while(|&&b| b != 0).count() + 1;
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
