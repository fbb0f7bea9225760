//! Models from scenes and asset folders, solving them, and f64 views of the results that share no code with the
//! library.

use std::ops::Range;
use std::panic::resume_unwind;

use vrtm::{
    Asset, Backend, Device, DeviceSettings, FetchKind, ImageLayout, ImageView, ImageViewMut, MeshSource,
    Origin, OutputTexel, PixelFormat, Quality, Results, SolveOptions, Strided, TileSettings, UvSource, Weld,
};

use crate::asset::Lab as _;
use crate::scenes::{self, Scene, TileMaps as Maps};

/// A mesh at rest, its frames, and the maps of its tiles.
#[derive(Clone, Debug, Default)]
pub struct Model {
    pub name: String,
    pub rest: Vec<[f32; 3]>,
    pub face_counts: Vec<u32>,
    pub indices: Vec<u32>,
    pub uvs: Vec<[f32; 2]>,
    pub uv_indices: Vec<u32>,
    pub frames: Vec<Vec<[f32; 3]>>,
    pub maps: Vec<Maps>,
    pub seams: Vec<[u32; 2]>,
    pub weld: Weld,
    pub max_layers: u32,
}

impl From<Scene> for Model {
    fn from(scene: Scene) -> Model {
        let Scene { name, rest, face_counts, indices, uvs, uv_indices, poses: frames, tiles: maps, .. } =
            scene;
        let name = name.into();
        Model { name, rest, face_counts, indices, uvs, uv_indices, frames, maps, ..Model::default() }
    }
}

impl Model {
    /// The mesh and the maps, without a name and frames.
    pub fn scene(&self) -> Scene {
        let Model { rest, face_counts, indices, uvs, uv_indices, maps, .. } = self.clone();
        Scene { rest, face_counts, indices, uvs, uv_indices, tiles: maps, ..Scene::default() }
    }

    /// The asset on a CPU device with `threads` threads (0 = one per core); every tile has a grid of `grid` by `grid`
    /// cells.
    pub fn asset(&self, threads: u32, grid: u32) -> Asset {
        self.asset_on(&cpu(threads), grid)
    }

    /// The asset on a given device; every tile has a grid of `grid` by `grid` cells.
    pub fn asset_on(&self, device: &Device, grid: u32) -> Asset {
        let mut asset = self.bare_on(device, Strided::from_slice(&self.rest));
        self.maps.iter().for_each(|maps| paint(&mut asset, maps));
        set_grid(&mut asset, grid);
        asset
    }

    /// The asset as `asset_on` makes it, solved for a frame, numbered from 1.
    pub fn solved(&self, device: &Device, grid: u32, frame: usize, options: &SolveOptions) -> Asset {
        let mut asset = self.asset_on(device, grid);
        asset.solve(self.frame(frame), options).unwrap();
        asset
    }

    /// The asset on a CPU device, without maps and with other rest positions.
    pub fn bare(&self, threads: u32, rest: Strided) -> Asset {
        self.bare_on(&cpu(threads), rest)
    }

    /// The asset on a given device, without maps and with other rest positions.
    pub fn bare_on(&self, device: &Device, rest: Strided) -> Asset {
        let [u, v] = [0, 1].map(|k| self.uvs.iter().map(|uv| uv[k]).collect::<Vec<f32>>());
        let uvs = UvSource {
            u: Strided::from_slice(&u),
            v: Some(Strided::from_slice(&v)),
            indices: Some(&self.uv_indices),
        };
        let source = MeshSource {
            positions: rest,
            face_counts: Some(&self.face_counts),
            indices: &self.indices,
            uvs,
            seams: &self.seams,
            weld: self.weld,
            max_layers: self.max_layers,
            ..MeshSource::default()
        };
        Asset::new(device, &source).unwrap()
    }

    /// Positions of a frame, numbered from 1.
    pub fn frame(&self, number: usize) -> Strided<'_> {
        Strided::from_slice(&self.frames[number - 1])
    }

    /// Marks the vertices of the faces all of whose UVs satisfy `f`.
    pub fn vertices(&self, f: impl Fn([f32; 2]) -> bool) -> Vec<bool> {
        let mut chosen = vec![false; self.rest.len()];
        for face in self.faces() {
            if face.clone().all(|c| f(self.uvs[self.uv_indices[c] as usize])) {
                face.for_each(|c| chosen[self.indices[c] as usize] = true);
            }
        }
        chosen
    }

    /// The model twice over itself, in layers: the second time, it takes the last pose.
    #[must_use]
    pub fn twice(&self) -> Model {
        let vertices = self.rest.len() as u32;
        let both =
            |list: &[u32], more: u32| list.iter().copied().chain(list.iter().map(|i| i + more)).collect();
        let pose = [&self.frames[0][..], &self.frames[self.frames.len() - 1][..]].concat();
        Model {
            rest: [&self.rest[..], &self.rest[..]].concat(),
            face_counts: both(&self.face_counts, 0),
            indices: both(&self.indices, vertices),
            uv_indices: both(&self.uv_indices, 0),
            frames: vec![pose],
            max_layers: 8,
            ..self.clone()
        }
    }

    /// The range of corners of each face.
    pub fn faces(&self) -> impl Iterator<Item = Range<usize>> {
        faces(&self.face_counts)
    }
}

/// The range of corners of each face, from the numbers of corners.
pub fn faces(counts: &[u32]) -> impl Iterator<Item = Range<usize>> {
    let mut end = 0;
    counts.iter().map(move |&count| {
        end += count as usize;
        end - count as usize..end
    })
}

/// Sets the maps of their tile.
pub fn paint(asset: &mut Asset, maps: &Maps) {
    let tile = asset.find_tile(maps.udim).expect("a tile of the maps");
    let image = |bytes| view(bytes, maps.width, maps.height);
    asset.tile_mut(tile).set_rigidity(Some(image(&maps.rigidity))).unwrap();
    asset.tile_mut(tile).set_mask(maps.mask.as_ref().map(|mask| image(mask))).unwrap();
}

/// A CPU device with `threads` threads (0 = one per core).
pub fn cpu(threads: u32) -> Device {
    Device::new(&DeviceSettings {
        backend: Backend::Cpu,
        threads: std::num::NonZeroU32::new(threads),
        ..DeviceSettings::default()
    })
    .unwrap()
}

/// The analytic scenes, with one frame each.
pub fn analytic() -> Vec<Model> {
    scenes::analytic::all().into_iter().map(Model::from).collect()
}

/// A view of an 8-bit map whose first row is at v = 1.
pub fn view(bytes: &[u8], width: u32, height: u32) -> ImageView<'_> {
    ImageView::new("map", bytes, ImageLayout::packed(width, height, PixelFormat::U8)).unwrap()
}

/// Gives every tile a grid of `grid` by `grid` cells, or with 0 one that resolves its features.
pub fn set_grid(asset: &mut Asset, grid: u32) {
    change_all(asset, |settings| settings.grid = [(grid > 0).then_some(grid); 2]);
}

/// Changes the settings of a tile.
pub fn change(asset: &mut Asset, tile: usize, with: impl FnOnce(&mut TileSettings)) {
    let mut settings = asset.tile_mut(tile).settings().unwrap();
    with(&mut settings);
    asset.tile_mut(tile).set_settings(&settings).unwrap();
}

/// Changes the settings of all tiles.
pub fn change_all(asset: &mut Asset, with: impl Fn(&mut TileSettings)) {
    (0..asset.tile_count()).for_each(|tile| change(asset, tile, &with));
}

/// Default options with another quality.
pub fn options(quality: Quality) -> SolveOptions {
    SolveOptions { quality, ..SolveOptions::default() }
}

/// Fetches an output with two f32 channels, first row at v = 0. Texels that the library does not write stay NaN.
pub fn fetch(asset: &mut Asset, tile: usize, kind: FetchKind, size: [u32; 2]) -> Vec<[f32; 2]> {
    texels(asset.results(), tile, kind, size, [f32::NAN; 2])
}

/// Fetches an output in texels that have its channels, first row at v = 0. Those that the library does not write stay
/// as `blank`.
pub fn texels<T: OutputTexel + Clone>(
    results: &Results,
    tile: usize,
    kind: FetchKind,
    size: [u32; 2],
    blank: T,
) -> Vec<T> {
    image(size, blank, |image| results.tile(tile).fetch(kind, image))
}

/// The bytes of an image of a layout; those that the library does not write are `fill`.
pub fn raw(
    asset: &Asset,
    tile: usize,
    kind: FetchKind,
    layout: ImageLayout,
    bytes: usize,
    fill: u8,
) -> Vec<u8> {
    let mut out = vec![fill; bytes];
    asset.tile(tile).fetch(kind, &mut ImageViewMut::new("image", &mut out, layout).unwrap()).unwrap();
    out
}

/// The dilation of a tile, first row at v = 0.
pub fn dilation<T: OutputTexel + Clone>(
    asset: &Asset,
    tile: usize,
    reach: f64,
    size: u32,
    blank: T,
) -> Vec<T> {
    image([size; 2], blank, |image| asset.results().tile(tile).fetch_dilation(reach, image))
}

fn image<T: OutputTexel + Clone>(
    size: [u32; 2],
    blank: T,
    write: impl FnOnce(&mut ImageViewMut) -> vrtm::Result<()>,
) -> Vec<T> {
    let mut texels = vec![blank; (size[0] * size[1]) as usize];
    let image = ImageViewMut::from_texels("image", &mut texels, size).unwrap();
    write(&mut image.with_origin(Origin::Bottom)).unwrap();
    texels
}

/// The redirected UVs of all corners.
pub fn corner_uvs(asset: &Asset) -> Vec<[f32; 2]> {
    let mut uvs = vec![[f32::NAN; 2]; asset.info().corners as usize];
    asset.corner_uvs(0, &mut uvs).unwrap();
    uvs
}

/// The corners of the quads of a sheet, row by row, whose vertices are those of a lattice, row by row, from `first` on.
pub fn quads([nx, ny]: [usize; 2], first: usize) -> Vec<u32> {
    let row = nx + 1;
    let corner = (0..ny).flat_map(|j| (0..nx).map(move |i| first + j * row + i));
    corner.flat_map(|a| [a, a + 1, a + row + 1, a + row]).map(|v| v as u32).collect()
}

/// Reads pairs of f32 in native byte order.
pub fn floats(bytes: &[u8]) -> Vec<[f32; 2]> {
    let float = |b: &[u8]| f32::from_ne_bytes([b[0], b[1], b[2], b[3]]);
    bytes.chunks_exact(8).map(|b| [float(b), float(&b[4..])]).collect()
}

/// The bits of the displacements of all tiles.
pub fn bits(asset: &Asset) -> Vec<[u32; 2]> {
    (0..asset.tile_count())
        .flat_map(|tile| asset.displacements(tile).unwrap())
        .map(|u| u.map(f32::to_bits))
        .collect()
}

/// Converts positions to f64.
pub fn doubles(positions: &[[f32; 3]]) -> Vec<[f64; 3]> {
    positions.iter().map(|p| p.map(f64::from)).collect()
}

/// Runs `job` on all items, on as many threads as there are cores; the results are in the order of the items.
pub fn on_all_cores<T: Sync, R: Send>(items: &[T], job: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    let next = std::sync::atomic::AtomicUsize::new(0);
    let mut results: Vec<(usize, R)> = std::thread::scope(|scope| {
        let work = || {
            let take = || next.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            std::iter::repeat_with(take)
                .take_while(|&k| k < items.len())
                .map(|k| (k, job(&items[k])))
                .collect::<Vec<_>>()
        };
        let threads: Vec<_> = (0..cores).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|t| t.join().unwrap_or_else(|panic| resume_unwind(panic))).collect()
    });
    results.sort_by_key(|(k, _)| *k);
    results.into_iter().map(|(_, result)| result).collect()
}
