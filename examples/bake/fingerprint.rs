//! A hash of everything that a file's content depends on, so that a farm can tell whether it is up to date.

use vrtm::{Backend, DeviceInfo};
use xxhash_rust::xxh3::Xxh3;

use crate::maps::Map;
use crate::mesh::Mesh;

/// Collects what a content depends on. Paths, threads and the time are none of it.
#[derive(Clone, Default)]
pub struct Fingerprint(Xxh3);

impl Fingerprint {
    /// What all files of a bake depend on, except for poses and maps.
    pub fn new(mesh: &Mesh, device: &DeviceInfo) -> Fingerprint {
        let mut hash = Fingerprint::default();
        hash.text(env!("CARGO_PKG_VERSION"));
        hash.text(&format!("{:?}", device.backend));
        // The CPU gives the same bits on every machine.
        if device.backend == Backend::Gpu {
            hash.text(&device.name);
        }
        hash.floats(mesh.rest.as_flattened());
        hash.floats(mesh.uvs.as_flattened());
        for list in [&mesh.face_counts, &mesh.indices, &mesh.uv_indices] {
            hash.bytes(&list.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>());
        }
        hash
    }

    pub fn text(&mut self, text: &str) {
        self.bytes(text.as_bytes());
    }

    pub fn floats(&mut self, values: &[f32]) {
        self.bytes(&values.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>());
    }

    pub fn map(&mut self, map: Option<&Map>) {
        let Some(map) = map else { return self.text("none") };
        self.text(&format!("{:?} {} {}", map.format, map.width, map.height));
        self.bytes(&map.bytes);
    }

    /// With the length before them, so that no two lists of inputs run together to the same bytes.
    fn bytes(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    /// 128 bits in hex.
    pub fn hex(&self) -> String {
        format!("{:032x}", self.0.digest128())
    }
}
