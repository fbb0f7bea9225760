//! Handles: plain numbers that are checked on every use, so that a wrong handle is an error and never a wild pointer.
//!
//! An object's serial number is never given out twice, which makes a stale handle impossible to mistake for a
//! living one. Serials start at a random number, so that handles of another copy of the library fail as well.
//!
//! ```text
//! bit 63..60  kind
//!     59..40  index of the tile, in tile handles
//!     39..0   serial number of the device, asset, job, refinement or carrier
//! ```

use std::collections::BTreeMap;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::sync::{Arc, Mutex};

use super::shared::SharedAsset;
use super::status::{Failure, Outcome, VRTM_ERROR_INVALID_HANDLE, VRTM_ERROR_OUT_OF_MEMORY};
use vrtm::{Asset, Device};
use vrtm_core::panics::lock;

/// A device: where assets are solved. Zero = no device.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct vrtm_device {
    /// Opaque.
    pub id: u64,
}

/// An asset: one mesh with its tiles, their maps, settings and results. Zero = no asset.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct vrtm_asset {
    /// Opaque.
    pub id: u64,
}

/// A tile: one UDIM unit square of an asset, or one layer of it (vrtm_mesh_desc.max_layers). It belongs to the asset
/// and is destroyed with it. Handles of the same tile are equal. Zero = no tile.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct vrtm_tile {
    /// Opaque.
    pub id: u64,
}

/// A job: one solve that runs beside the host's own work, made by vrtm_asset_submit. Zero = no job.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct vrtm_job {
    /// Opaque.
    pub id: u64,
}

/// A refinement: an asset's mesh with its triangles split, for hosts that support only UV sets. Zero = no refinement.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct vrtm_refinement {
    /// Opaque.
    pub id: u64,
}

/// A carrier: points bound to an asset's rest surface, which its solves move along. Zero = no carrier.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct vrtm_carrier {
    /// Opaque.
    pub id: u64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Device = 1,
    Asset = 2,
    Tile = 3,
    Job = 4,
    Refinement = 5,
    Carrier = 6,
}

const SERIAL_BITS: u32 = 40;
const TILE_BITS: u32 = 20;
/// Number of tiles that a handle can distinguish.
const MAX_TILES: usize = 1 << TILE_BITS;

fn pack(kind: Kind, serial: u64, tile: usize) -> u64 {
    (kind as u64) << (SERIAL_BITS + TILE_BITS) | (tile as u64) << SERIAL_BITS | serial
}

/// Serial number and tile index, if the handle has this kind.
fn unpack(kind: Kind, id: u64) -> Option<(u64, usize)> {
    let serial = id & ((1 << SERIAL_BITS) - 1);
    let tile = (id >> SERIAL_BITS) as usize & (MAX_TILES - 1);
    (pack(kind, serial, tile) == id && (kind == Kind::Tile || tile == 0)).then_some((serial, tile))
}

/// All living objects of one kind. The lock is held only for look-ups, never while an object works or is dropped.
pub(super) struct Table<T> {
    kind: Kind,
    /// The kind's name, for messages.
    name: &'static str,
    entries: Mutex<Entries<T>>,
}

struct Entries<T> {
    next: u64,
    live: BTreeMap<u64, Arc<T>>,
}

impl<T> Table<T> {
    pub const fn new(kind: Kind, name: &'static str) -> Table<T> {
        Table { kind, name, entries: Mutex::new(Entries { next: 0, live: BTreeMap::new() }) }
    }

    /// Adds an object; returns its handle's number.
    pub fn add(&self, value: T) -> Outcome<u64> {
        let value = Arc::new(value);
        let mut entries = lock(&self.entries);
        if entries.next == 0 {
            let random = RandomState::new().build_hasher().finish();
            entries.next = 1 + (random & ((1 << (SERIAL_BITS - 2)) - 1));
        }
        let serial = entries.next;
        if serial >> SERIAL_BITS != 0 {
            return Err(Failure::new(VRTM_ERROR_OUT_OF_MEMORY, "all handles of this process are used up"));
        }
        entries.next += 1;
        #[expect(clippy::disallowed_methods, reason = "a few bytes for each object")]
        entries.live.insert(serial, value);
        Ok(pack(self.kind, serial, 0))
    }

    fn find(&self, serial: u64) -> Option<Arc<T>> {
        lock(&self.entries).live.get(&serial).cloned()
    }

    /// The living object of the handle that is given as `argument`.
    pub fn get(&self, argument: &str, id: u64) -> Outcome<Arc<T>> {
        let found = unpack(self.kind, id).and_then(|(serial, _)| self.find(serial));
        found.ok_or_else(|| gone(argument, self.name, id))
    }

    /// Ends a handle; returns its object.
    pub fn remove(&self, id: u64) -> Outcome<Arc<T>> {
        let (serial, _) = unpack(self.kind, id).ok_or_else(|| gone(self.name, self.name, id))?;
        let mut entries = lock(&self.entries);
        let removed = entries.live.remove(&serial);
        if entries.live.is_empty() {
            // An emptied tree keeps its root, which unloading the library would leave behind.
            entries.live = BTreeMap::new();
        }
        removed.ok_or_else(|| gone(self.name, self.name, id))
    }
}

pub(super) static DEVICES: Table<Device> = Table::new(Kind::Device, "device");
pub(super) static ASSETS: Table<SharedAsset> = Table::new(Kind::Asset, "asset");

fn gone(argument: &str, kind: &str, id: u64) -> Failure {
    let message = match id {
        0 => format!("{argument}: the handle is zero"),
        _ => format!("{argument}: the handle {id:#x} is no living {kind}"),
    };
    Failure { status: VRTM_ERROR_INVALID_HANDLE, message }
}

pub(super) fn add_asset(asset: Asset) -> Outcome<vrtm_asset> {
    let shared = SharedAsset::new(asset);
    let tiles = shared.info.tiles;
    if tiles as usize > MAX_TILES {
        return Err(Failure::unsupported(format!("desc.uvs: {tiles} tiles are over {MAX_TILES}")));
    }
    Ok(vrtm_asset { id: ASSETS.add(shared)? })
}

pub(super) fn asset(handle: vrtm_asset) -> Outcome<Arc<SharedAsset>> {
    ASSETS.get("asset", handle.id)
}

/// The handle of a tile of a living asset.
pub(super) fn tile_handle(asset: vrtm_asset, tile: usize) -> vrtm_tile {
    let serial = asset.id & ((1 << SERIAL_BITS) - 1);
    vrtm_tile { id: pack(Kind::Tile, serial, tile) }
}

/// A tile's asset and its index in it. `argument` is the C argument's name.
pub(super) fn tile(argument: &str, handle: vrtm_tile) -> Outcome<(Arc<SharedAsset>, usize)> {
    unpack(Kind::Tile, handle.id)
        .and_then(|(serial, tile)| Some((ASSETS.find(serial)?, tile)))
        .filter(|(asset, tile)| *tile < asset.info.tiles as usize)
        .ok_or_else(|| gone(argument, "tile", handle.id))
}

/// True if both belong to the same asset.
pub(super) fn is_tile_of(tile: vrtm_tile, asset: vrtm_asset) -> bool {
    let mask = (1 << SERIAL_BITS) - 1;
    tile.id & mask == asset.id & mask
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_handles_of_tiles_have_an_index() {
        assert_eq!(unpack(Kind::Tile, pack(Kind::Tile, 7, 3)), Some((7, 3)));
        assert_eq!(unpack(Kind::Asset, pack(Kind::Asset, 7, 3)), None);
        assert_eq!(unpack(Kind::Asset, pack(Kind::Tile, 7, 0)), None);
    }

    #[test]
    fn handles_are_given_out_once_by_many_threads() {
        let table: Table<u32> = Table::new(Kind::Job, "job");
        let distinct = Mutex::new(std::collections::BTreeSet::new());
        let work = || {
            for i in 0..1000 {
                let serial = table.add(i).unwrap();
                if i % 2 == 0 {
                    assert_eq!(*table.remove(serial).unwrap(), i);
                }
                assert!(lock(&distinct).insert(serial), "{serial} came twice");
            }
        };
        std::thread::scope(|scope| (0..4).for_each(|_| _ = scope.spawn(work)));
        assert_eq!(lock(&table.entries).live.len(), 2000);
    }
}
