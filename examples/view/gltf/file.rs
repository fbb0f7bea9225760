//! A file, its buffers, and the numbers in them. Every index and length comes from the file and is checked where it is
//! used; an error says what is wrong.

use std::path::{Path, PathBuf};

use gltf::json::accessor::{ComponentType, Type};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Root, buffer};

use super::uri;
use crate::failure;

/// Extensions that a file may require; those of materials and lights change nothing that is read.
const KNOWN: [&str; 2] = ["KHR_mesh_quantization", "KHR_texture_transform"];
const HARMLESS: [&str; 3] = ["KHR_materials_", "KHR_lights_", "EXT_lights_"];
/// Most bytes of an accessor that has no data of its own and is zero.
const MOST_ZEROS: usize = 1 << 28;
/// Bytes of the head of a GLB and of that of its first chunk.
const HEADS: u32 = 20;

/// A file that is read.
pub struct File {
    pub root: Root,
    buffers: Vec<Vec<u8>>,
    folder: PathBuf,
    /// All files that were read.
    pub read: Vec<PathBuf>,
}

impl File {
    pub fn open(path: &Path) -> Result<File, String> {
        let bytes = contents(path)?;
        let (root, blob): (Root, Option<Vec<u8>>) = if bytes.starts_with(b"glTF") {
            // Shorter than its heads: the reader subtracts them.
            if bytes.get(8..12).is_some_and(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) < HEADS) {
                return Err("damaged: it is shorter than its head".into());
            }
            let glb = gltf::Glb::from_slice(&bytes).map_err(|error| format!("damaged: {error}"))?;
            (json(&glb.json)?, glb.bin.map(Into::into))
        } else {
            (json(&bytes)?, None)
        };
        if !root.asset.version.starts_with("2.") {
            return Err(format!("glTF {}: only version 2 is read", root.asset.version));
        }
        let is_known =
            |name: &&String| KNOWN.contains(&name.as_str()) || HARMLESS.iter().any(|h| name.starts_with(h));
        if let Some(name) = root.extensions_required.iter().find(|name| !is_known(name)) {
            return Err(format!("requires the extension {name}, which is not read: export it without"));
        }
        let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
        let mut file = File { root, buffers: Vec::new(), folder, read: vec![path.into()] };
        file.buffers = file.read_buffers(blob)?;
        Ok(file)
    }

    fn read_buffers(&mut self, mut blob: Option<Vec<u8>>) -> Result<Vec<Vec<u8>>, String> {
        let mut all = Vec::new();
        for (k, buffer) in self.root.buffers.clone().iter().enumerate() {
            let bytes = match &buffer.uri {
                Some(uri) => self.resource(uri).map_err(|reason| format!("buffer {k}: {reason}"))?,
                None => blob.take().filter(|_| k == 0).ok_or(format!("buffer {k} has no data"))?,
            };
            let length = buffer.byte_length.0;
            if (bytes.len() as u64) < length {
                return Err(format!("buffer {k} has {} of its {length} bytes", bytes.len()));
            }
            all.push(bytes);
        }
        Ok(all)
    }

    /// The bytes behind a URI.
    pub fn resource(&mut self, text: &str) -> Result<Vec<u8>, String> {
        if let Some(data) = uri::data(text) {
            return data;
        }
        let path = self.folder.join(uri::path(text)?);
        let bytes = contents(&path).map_err(|reason| format!("{}: {reason}", path.display()))?;
        self.read.push(path);
        Ok(bytes)
    }

    /// The bytes of a view.
    pub fn view(&self, index: Index<buffer::View>) -> Result<&[u8], String> {
        let view = self.root.get(index).ok_or_else(|| format!("buffer view {} is missing", index.value()))?;
        let number = view.buffer.value();
        let buffer = self.buffers.get(number).ok_or_else(|| format!("buffer {number} is missing"))?;
        let start = view.byte_offset.map_or(0, |offset| offset.0);
        let end = start.checked_add(view.byte_length.0).filter(|&end| end <= buffer.len() as u64);
        let end = end.ok_or_else(|| format!("buffer view {} ends behind its buffer", index.value()))?;
        Ok(&buffer[start as usize..end as usize])
    }

    /// Numbers of an accessor, one element after the other; those that are normalized lie between -1 and 1.
    pub fn numbers(&self, index: Index<Accessor>, of: Type) -> Result<Vec<f32>, String> {
        let Raw { component, normalized, bytes } = self.raw(index, of)?;
        let largest = match component {
            ComponentType::I8 if normalized => 127.0,
            ComponentType::U8 if normalized => 255.0,
            ComponentType::I16 if normalized => 32767.0,
            ComponentType::U16 if normalized => 65535.0,
            _ => 1.0,
        };
        let least = if normalized { -1.0 } else { f64::MIN };
        let numbers: Vec<f32> = decoded(&bytes, component).map(|x| (x / largest).max(least) as f32).collect();
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(at) => Err(format!("accessor {}: number {at} is {}", index.value(), numbers[at])),
            None => Ok(numbers),
        }
    }

    /// Points of an accessor.
    pub fn points(&self, index: Index<Accessor>) -> Result<Vec<[f32; 3]>, String> {
        Ok(self.numbers(index, Type::Vec3)?.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect())
    }

    /// Whole numbers of an accessor, one element after the other.
    pub fn integers(&self, index: Index<Accessor>, of: Type) -> Result<Vec<u32>, String> {
        let Raw { component, bytes, .. } = self.raw(index, of)?;
        if !matches!(component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
            return Err(format!("accessor {} holds no unsigned integers", index.value()));
        }
        Ok(decoded(&bytes, component).map(|x| x as u32).collect())
    }

    fn raw(&self, index: Index<Accessor>, of: Type) -> Result<Raw, String> {
        let failed = |reason: &str| format!("accessor {}: {reason}", index.value());
        let accessor = self.root.get(index).ok_or_else(|| failed("is missing"))?;
        let (Checked::Valid(found), Checked::Valid(component)) = (&accessor.type_, &accessor.component_type)
        else {
            return Err(failed("has an unknown type"));
        };
        if *found != of {
            return Err(failed(&format!("is {found:?} in place of {of:?}")));
        }
        let component = component.0;
        let size = component.size() * of.multiplicity();
        let count = usize::try_from(accessor.count.0).map_err(|_| failed("has too many elements"))?;
        let offset = accessor.byte_offset.map_or(0, |offset| offset.0);
        let mut bytes = match (accessor.buffer_view, &accessor.sparse) {
            (Some(view), _) => self.packed(view, offset, count, size).map_err(|reason| failed(&reason))?,
            (None, None) => return Err(failed("has no data")),
            (None, Some(_)) => {
                let length = count.checked_mul(size).filter(|&length| length <= MOST_ZEROS);
                vec![0; length.ok_or_else(|| failed("has too many elements"))?]
            }
        };
        if let Some(sparse) = &accessor.sparse {
            let count = usize::try_from(sparse.count.0).map_err(|_| failed("has too many elements"))?;
            let Checked::Valid(of_places) = &sparse.indices.component_type else {
                return Err(failed("has an unknown type"));
            };
            let width = of_places.0.size();
            let (places, values) = (&sparse.indices, &sparse.values);
            let part =
                |view, offset, size| self.packed(view, offset, count, size).map_err(|reason| failed(&reason));
            let values = part(values.buffer_view, values.byte_offset.0, size)?;
            let places = part(places.buffer_view, places.byte_offset.0, width)?;
            for (place, value) in places.chunks_exact(width).zip(values.chunks_exact(size)) {
                let place = place.iter().rev().fold(0, |sum, &b| sum << 8 | usize::from(b));
                let target =
                    place.checked_mul(size).and_then(|start| bytes.get_mut(start..start.checked_add(size)?));
                target.ok_or_else(|| failed("a sparse value lies behind its end"))?.copy_from_slice(value);
            }
        }
        Ok(Raw { component, normalized: accessor.normalized, bytes })
    }

    /// Elements of a view without what lies between them.
    fn packed(
        &self,
        view: Index<buffer::View>,
        offset: u64,
        count: usize,
        size: usize,
    ) -> Result<Vec<u8>, String> {
        let stride =
            self.root.get(view).and_then(|view| view.byte_stride).map_or(size, |stride| stride.0).max(size);
        let bytes = self.view(view)?;
        if count == 0 {
            return Ok(Vec::new());
        }
        let start = usize::try_from(offset).ok().filter(|&start| start <= bytes.len());
        let bytes = start.map_or(&[][..], |start| &bytes[start..]);
        if (count - 1)
            .checked_mul(stride)
            .and_then(|last| last.checked_add(size))
            .is_none_or(|end| end > bytes.len())
        {
            return Err(format!("its {count} elements end behind buffer view {}", view.value()));
        }
        let elements = bytes.chunks(stride).take(count);
        Ok(elements.flat_map(|element| &element[..size]).copied().collect())
    }
}

/// Elements of an accessor.
struct Raw {
    component: ComponentType,
    normalized: bool,
    bytes: Vec<u8>,
}

fn contents(path: &Path) -> Result<Vec<u8>, String> {
    // The caller names the path.
    let name = format!("{}: ", path.display());
    failure::read(path).map_err(|failure| failure.0.strip_prefix(&name).unwrap_or(&failure.0).to_string())
}

fn json(bytes: &[u8]) -> Result<Root, String> {
    gltf::json::deserialize::from_slice(bytes).map_err(|error| format!("is no glTF: {error}"))
}

fn decoded(bytes: &[u8], component: ComponentType) -> impl Iterator<Item = f64> {
    bytes.chunks_exact(component.size()).map(move |b| match component {
        ComponentType::I8 => (b[0] as i8).into(),
        ComponentType::U8 => b[0].into(),
        ComponentType::I16 => i16::from_le_bytes([b[0], b[1]]).into(),
        ComponentType::U16 => u16::from_le_bytes([b[0], b[1]]).into(),
        ComponentType::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
        ComponentType::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
    })
}
