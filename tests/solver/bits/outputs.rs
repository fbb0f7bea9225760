//! Everything that a result hands out, as hashes.

use vrtm::{
    Asset, FetchKind, ImageLayout, ImageViewMut, Origin, PixelFormat, Refinement, RefinementPattern,
    RefinementSettings, Strain,
};

use super::hash::Hash;
use vrtm_testkit::bits;

const SIZE: [u32; 2] = [61, 47];

impl Hash {
    pub fn floats<'a>(&mut self, values: impl IntoIterator<Item = &'a f32>) {
        values.into_iter().for_each(|x| self.add(x.to_bits().into()));
    }

    pub fn integers(&mut self, values: impl IntoIterator<Item = u32>) {
        values.into_iter().for_each(|x| self.add(x.into()));
    }
}

/// Displacements, redirections, corner UVs, and what is reported of a result and of the tiles.
pub fn result(asset: &mut Asset) -> Hash {
    let mut hash = Hash::default();
    hash.integers(bits(asset).into_iter().flatten());
    for tile in 0..asset.tile_count() {
        hash.image(asset, tile, FetchKind::Redirection, PixelFormat::F32);
        let info = asset.tile_mut(tile).info().unwrap();
        hash.integers([info.charts, info.layer, info.grid[0], info.grid[1]]);
        for n in [info.movable_nodes, info.rigid_nodes, info.gap_nodes, info.border_edges, info.edges_apart] {
            hash.add(n);
        }
        let report = asset.tile(tile).report().unwrap();
        for x in [report.energy_before, report.energy, report.min_jacobian] {
            hash.add(x.to_bits());
        }
        hash.floats(&[report.max_displacement, report.max_limit]);
        hash.integers([report.sweeps, report.corrections, report.charts_active, report.welds_torn]);
        for n in [report.folds, report.node_updates, report.texels_limited] {
            hash.add(n);
        }
        for strain in report.strain.iter().flat_map(|strain| [strain.before, strain.after]) {
            let Strain { rms, median, p95, p99, max, border_rms, interior_rms, free_rms, .. } = strain;
            hash.floats(&[rms, median, p95, p99, max, border_rms, interior_rms, free_rms]);
        }
        hash.floats(report.strain.iter().flat_map(|strain| [&strain.harm, &strain.help]));
    }
    hash.corner_uvs(asset, 0);
    hash
}

impl Hash {
    fn bytes(&mut self, size: usize, write: impl FnOnce(&mut [u8])) {
        let mut bytes = vec![0xa5; size];
        write(&mut bytes);
        bytes.into_iter().for_each(|byte| self.byte(byte));
    }

    pub fn image(&mut self, asset: &mut Asset, tile: usize, kind: FetchKind, format: PixelFormat) {
        let layout = ImageLayout::packed(SIZE[0], SIZE[1], format).with_channels(kind.channels());
        let size = (SIZE[0] * SIZE[1] * kind.channels()) as usize * format.size();
        self.bytes(size, |bytes| {
            asset.tile(tile).fetch(kind, &mut ImageViewMut::new("image", bytes, layout).unwrap()).unwrap();
        });
    }

    pub fn dilation(&mut self, asset: &Asset, tile: usize, format: PixelFormat) {
        let layout = ImageLayout { origin: Origin::Bottom, ..ImageLayout::packed(SIZE[0], SIZE[1], format) };
        let layout = layout.with_channels(4);
        self.bytes((SIZE[0] * SIZE[1]) as usize * 4 * format.size(), |bytes| {
            let mut image = ImageViewMut::new("image", bytes, layout).unwrap();
            asset.results().tile(tile).fetch_dilation(0.05, &mut image).unwrap();
        });
    }

    pub fn corner_uvs(&mut self, asset: &Asset, set: u32) {
        let mut uvs = vec![[f32::NAN; 2]; asset.info().corners as usize];
        asset.corner_uvs(set, &mut uvs).unwrap();
        self.floats(uvs.iter().flatten());
    }

    fn refinement(&mut self, refinement: &Refinement) {
        let info = refinement.info();
        let [vertices, faces, corners] = [info.vertices, info.faces, info.corners].map(|n| n as usize);
        let (mut of_vertices, mut of_corners) = (vec![[0; 3]; vertices], vec![[0; 3]; corners]);
        let (mut weights, mut of_corner) = (vec![[0.0; 3]; vertices], vec![[0.0; 3]; corners]);
        let (mut own, mut counts, mut indices) = (vec![0; faces], vec![0; faces], vec![0; corners]);
        let mut uvs = [vec![[0.0; 2]; corners], vec![[0.0; 2]; corners]];
        let mut pattern = RefinementPattern {
            vertex_sources: Some(&mut of_vertices),
            vertex_weights: Some(&mut weights),
            face_sources: Some(&mut own),
            face_counts: Some(&mut counts),
            corner_vertices: Some(&mut indices),
            corner_sources: Some(&mut of_corners),
            corner_weights: Some(&mut of_corner),
            corner_uvs: Some(&mut uvs[0]),
        };
        refinement.pattern(&mut pattern).unwrap();
        refinement.corner_uvs(&mut uvs[1]).unwrap();
        self.integers(of_vertices.into_iter().chain(of_corners).flatten());
        self.integers(own.into_iter().chain(counts).chain(indices));
        self.floats(weights.iter().chain(&of_corner).flatten());
        self.floats(uvs.iter().flatten().flatten());
        self.add(info.error.to_bits());
    }
}

/// A hash of each kind of output of a tile, and of a refinement that goes on after `again`, which solves another frame.
pub fn kinds(asset: &mut Asset, tile: usize, again: impl Fn(&mut Asset)) -> Vec<(&'static str, Hash)> {
    let mut all = Vec::new();
    for (name, kind) in [
        ("redirection", FetchKind::Redirection),
        ("redirection, delta", FetchKind::RedirectionDelta),
        ("redirection, UDIM", FetchKind::RedirectionUdim),
        ("warp", FetchKind::Warp),
        ("Jacobian", FetchKind::Jacobian),
        ("filter scale", FetchKind::FilterScale),
        ("UV set", FetchKind::UvSet(1)),
        ("UV set, delta", FetchKind::UvSetDelta(1)),
    ] {
        let mut hash = Hash::default();
        for format in [PixelFormat::F32, PixelFormat::F16] {
            hash.image(asset, tile, kind, format);
        }
        all.push((name, hash));
    }
    let [mut dilation, mut corners, mut refined] = [(); 3].map(|()| Hash::default());
    for format in [PixelFormat::F32, PixelFormat::F16] {
        dilation.dilation(asset, tile, format);
    }
    (0..2).for_each(|set| corners.corner_uvs(asset, set));
    let settings = RefinementSettings { tolerance: 1.0 / 1024.0, ..RefinementSettings::default() };
    let mut refinement = asset.refine(&settings).unwrap();
    refined.refinement(&refinement);
    again(asset);
    refinement.extend().unwrap();
    refined.refinement(&refinement);
    all.extend([("dilation", dilation), ("corner UVs", corners), ("refinement", refined)]);
    all
}
