//! Writes files so that they appear complete or not at all: each gets a temporary name, and a frame's files are renamed
//! together.

use std::fs::{self, File};
use std::io::{BufWriter, Cursor, Seek, Write};
use std::path::{Path, PathBuf};

use exr::prelude::{Encoding, Image, Layer, LayerAttributes, SpecificChannels, WritableImage};

use crate::failure::{Failure, Result};
use crate::maps::Field;

/// Files to be renamed. If it is dropped without [`Staging::commit`], they are removed.
#[derive(Debug)]
pub struct Staging {
    folder: PathBuf,
    waiting: Vec<(PathBuf, PathBuf)>,
}

impl Staging {
    /// Makes the folder if it does not exist.
    pub fn new(folder: &Path) -> Result<Staging> {
        fs::create_dir_all(folder).map_err(|e| Failure::file(folder, e))?;
        Ok(Staging { folder: folder.into(), waiting: Vec::new() })
    }

    fn write(
        &mut self,
        name: &str,
        body: impl FnOnce(&mut BufWriter<File>) -> std::result::Result<(), String>,
    ) -> Result<()> {
        let path = self.folder.join(name);
        let temporary = self.folder.join(format!(".{name}.{}.part", std::process::id()));
        self.waiting.push((temporary.clone(), path.clone()));
        let file = File::create(&temporary).map_err(|e| Failure::file(&path, e))?;
        let mut writer = BufWriter::new(file);
        body(&mut writer).map_err(|e| Failure::file(&path, e))?;
        writer.flush().map_err(|e| Failure::file(&path, e))
    }

    /// Writes two f32 channels, R and G, with lossless compression (ZIP).
    pub fn exr(&mut self, name: &str, field: &Field<2>) -> Result<()> {
        self.write(name, |writer| write_exr(field, writer))
    }

    pub fn png(&mut self, name: &str, image: &image::RgbImage) -> Result<()> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, image::ImageFormat::Png).map_err(|e| Failure::named(name, e))?;
        self.text(name, bytes.get_ref())
    }

    pub fn text(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        self.write(name, |writer| writer.write_all(bytes).map_err(|e| e.to_string()))
    }

    /// Renames the files to their final names.
    pub fn commit(&mut self) -> Result<()> {
        for (temporary, path) in &self.waiting {
            fs::rename(temporary, path).map_err(|e| Failure::file(path, e))?;
        }
        self.waiting.clear();
        Ok(())
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        for (temporary, _) in &self.waiting {
            // Errors are ignored: the program already ends for another reason.
            let _ = fs::remove_file(temporary);
        }
    }
}

fn write_exr(field: &Field<2>, writer: impl Write + Seek) -> std::result::Result<(), String> {
    let channels = SpecificChannels::build().with_channel("R").with_channel("G").with_pixel_fn(|at| {
        let [u, v] = field.at(at.x(), at.y());
        (u, v)
    });
    let size = (field.width, field.height);
    let layer = Layer::new(size, LayerAttributes::default(), Encoding::SMALL_LOSSLESS, channels);
    Image::from_layer(layer).write().to_buffered(writer).map_err(|e| e.to_string())
}
