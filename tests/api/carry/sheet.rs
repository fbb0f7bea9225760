//! A sheet of squares over the unit square of parameters, as one chart or cut into two, and what is exactly known of
//! it.

use vrtm::{
    Asset, Bind, Carried, Carrier, CarrierSettings, Device, FetchKind, Fit, ImageView, MeshSource,
    SolveOptions, Strided, StridedMut, TileSettings, UvSource,
};
use vrtm_testkit::{cpu, texels};

pub type P2 = [f64; 2];
pub type P3 = [f64; 3];

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Layout {
    Whole,
    /// Two charts, the right one turned by half a turn.
    Cut,
    /// Two sheets over one another; the second one is 3 to the side and takes the pose mirrored in x.
    Stacked,
    /// UV set 0 has all in a dot, set 1 is whole.
    SecondSet,
}

#[derive(Clone, Debug)]
pub struct Sheet {
    pub side: usize,
    pub layout: Layout,
    pub parameters: Vec<P2>,
    pub rest: Vec<P3>,
    pub indices: Vec<u32>,
    /// Per corner.
    pub uvs: Vec<[f32; 2]>,
}

/// The UV of a parameter; `right` chooses the chart of a cut sheet.
pub fn uv(layout: Layout, [x, y]: P2, right: bool) -> P2 {
    match layout {
        Layout::Cut if right => [0.945 - 0.85 * (x - 0.5), 0.9 - 0.85 * y],
        Layout::Cut => [0.03 + 0.85 * x, 0.05 + 0.85 * y],
        _ => [0.05 + 0.9 * x, 0.05 + 0.9 * y],
    }
}

/// The parameter of a UV on a chart or beside it.
pub fn parameter(layout: Layout, [u, v]: P2, right: bool) -> P2 {
    match layout {
        Layout::Cut if right => [0.5 + (0.945 - u) / 0.85, (0.9 - v) / 0.85],
        Layout::Cut => [(u - 0.03) / 0.85, (v - 0.05) / 0.85],
        _ => [(u - 0.05) / 0.9, (v - 0.05) / 0.9],
    }
}

/// The chart that a UV lies in, and its parameter.
pub fn on_chart(layout: Layout, at: P2) -> Option<(bool, P2)> {
    let right = layout == Layout::Cut && at[0] > 0.5;
    let p = parameter(layout, at, right);
    let (low, high) = match layout {
        Layout::Cut if right => (0.5, 1.0),
        Layout::Cut => (0.0, 0.5),
        _ => (0.0, 1.0),
    };
    ((low..=high).contains(&p[0]) && (0.0..=1.0).contains(&p[1])).then_some((right, p))
}

impl Sheet {
    pub fn new(side: usize, layout: Layout, rest: impl Fn(P2) -> P3) -> Sheet {
        let mut sheet =
            Sheet { side, layout, parameters: vec![], rest: vec![], indices: vec![], uvs: vec![] };
        let copies = if layout == Layout::Stacked { 2 } else { 1 };
        for copy in 0..copies {
            let first = sheet.rest.len();
            for k in 0..(side + 1) * (side + 1) {
                let p = [k % (side + 1), k / (side + 1)].map(|n| n as f64 / side as f64);
                let [x, y, z] = rest(p);
                sheet.parameters.push(p);
                sheet.rest.push([x + 3.0 * copy as f64, y, z]);
            }
            for k in 0..side * side {
                let (i, j) = (k % side, k / side);
                let right = 2 * i >= side;
                for (i, j) in [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)] {
                    let vertex = first + j * (side + 1) + i;
                    sheet.indices.push(vertex as u32);
                    sheet.uvs.push(uv(layout, sheet.parameters[vertex], right).map(|x| x as f32));
                }
            }
        }
        sheet
    }

    /// Positions in a pose, which a second copy takes mirrored.
    pub fn pose(&self, pose: impl Fn(P2) -> P3) -> Vec<P3> {
        let one = (self.side + 1) * (self.side + 1);
        let of = |(k, p): (usize, &P2)| {
            if k < one {
                return pose(*p);
            }
            let [x, y, z] = pose([1.0 - p[0], p[1]]);
            [4.0 - x, y, z]
        };
        self.parameters.iter().enumerate().map(of).collect()
    }

    pub fn asset(
        &self,
        threads: u32,
        grid: u32,
        rigidity: impl Fn(P2) -> f64,
        settings: TileSettings,
    ) -> Asset {
        self.asset_on(&cpu(threads), grid, rigidity, settings)
    }

    pub fn asset_on(
        &self,
        device: &Device,
        grid: u32,
        rigidity: impl Fn(P2) -> f64,
        settings: TileSettings,
    ) -> Asset {
        let dot = vec![[0.5f32, 0.5]; self.uvs.len()];
        let of_set = |uvs| UvSource { u: Strided::from_slice(uvs), ..UvSource::default() };
        let second = [of_set(&self.uvs)];
        let is_second = self.layout == Layout::SecondSet;
        let counts = vec![4; self.indices.len() / 4];
        let source = MeshSource {
            positions: Strided::from_slice(&self.rest),
            face_counts: Some(&counts),
            indices: &self.indices,
            uvs: if is_second { of_set(&dot) } else { of_set(&self.uvs) },
            uv_sets: if is_second { &second } else { &[] },
            max_layers: if self.layout == Layout::Stacked { 2 } else { 0 },
            ..MeshSource::default()
        };
        let mut asset = Asset::new(device, &source).unwrap();
        let size = 4 * grid;
        let texel = |k: u32| {
            let at = [k % size, k / size].map(|n| (f64::from(n) + 0.5) / f64::from(size));
            // Rows come from the top. Beside the charts goes on what is nearest.
            let at = [at[0], 1.0 - at[1]];
            let p = parameter(self.layout, at, self.layout == Layout::Cut && at[0] > 0.5);
            (255.0 * rigidity(p)).round() as u8
        };
        let map: Vec<u8> = (0..size * size).map(texel).collect();
        for tile in 0..asset.tile_count() {
            let view = ImageView::from_texels("rigidity", &map, [size, size]).unwrap();
            asset.tile_mut(tile).set_rigidity(Some(view)).unwrap();
            let settings = TileSettings { grid: [Some(grid); 2], ..settings };
            asset.tile_mut(tile).set_settings(&settings).unwrap();
        }
        asset
    }

    /// A value at a parameter, linear on the triangles of the sheet; the second copy with `copy` 1.
    pub fn at(&self, values: &[P3], [x, y]: P2, copy: usize) -> P3 {
        let n = self.side as f64;
        let cell = [x, y].map(|x| (x * n).floor().clamp(0.0, n - 1.0));
        let (s, t) = (x * n - cell[0], y * n - cell[1]);
        let (i, j, w) = (cell[0] as usize, cell[1] as usize, self.side + 1);
        let get = |i: usize, j: usize| values[copy * w * w + j * w + i];
        // Squares are fans around their first corner.
        let (near, far) = (get(i, j), get(i + 1, j + 1));
        let (third, a, b) = if s >= t { (get(i + 1, j), s, t) } else { (get(i, j + 1), t, s) };
        std::array::from_fn(|k| near[k] + a * (third[k] - near[k]) + b * (far[k] - third[k]))
    }
}

/// Everything that a carrier gives.
#[derive(Clone, Debug, PartialEq)]
pub struct All {
    pub positions: Vec<P3>,
    pub rotations: Vec<[f64; 9]>,
    pub stretch: Vec<P2>,
    pub uvs: Vec<P2>,
}

pub fn fetch(carrier: &Carrier) -> All {
    fetch_some(carrier, 15)
}

/// Fetches the arrays of which `wanted` has the bits, in their order; all others are zeros.
pub fn fetch_some(carrier: &Carrier, wanted: u32) -> All {
    let n = carrier.info().points as usize;
    let mut all = All {
        positions: vec![[0.0; 3]; n],
        rotations: vec![[0.0; 9]; n],
        stretch: vec![[0.0; 2]; n],
        uvs: vec![[0.0; 2]; n],
    };
    let out = Carried {
        positions: Some(StridedMut::from_slice(&mut all.positions)).filter(|_| wanted & 1 != 0),
        rotations: Some(StridedMut::from_slice(&mut all.rotations)).filter(|_| wanted & 2 != 0),
        stretch: Some(StridedMut::from_slice(&mut all.stretch)).filter(|_| wanted & 4 != 0),
        uvs: Some(StridedMut::from_slice(&mut all.uvs)).filter(|_| wanted & 8 != 0),
    };
    carrier.fetch(&out).unwrap();
    all
}

/// A carrier of points with UVs.
pub fn by_uv(asset: &Asset, uvs: &[P2], heights: Option<&[f64]>, fit: Fit, uv_set: u32) -> Carrier {
    let by = Bind::Uv { uvs: Strided::from_slice(uvs), layers: None };
    let heights = heights.map(Strided::from_slice);
    asset.carrier(&CarrierSettings { uv_set, heights, fit, ..CarrierSettings::new(by) }).unwrap()
}

pub fn solve(asset: &mut Asset, pose: &[P3]) {
    asset.solve(Strided::from_slice(pose), &SolveOptions::default()).unwrap();
}

/// The redirection map of a tile: UVs at the centres of texels, from v = 0.
pub fn map(asset: &Asset, tile: usize, size: usize) -> Vec<P2> {
    let uvs = texels(asset.results(), tile, FetchKind::Redirection, [size as u32; 2], [0.0f32; 2]);
    uvs.into_iter().map(|uv| uv.map(f64::from)).collect()
}

pub fn distance(a: P3, b: P3) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// The product of a matrix, row by row, and a vector.
pub fn turned(m: [f64; 9], p: P3) -> P3 {
    [0, 3, 6].map(|r| (0..3).map(|k| m[r + k] * p[k]).sum())
}

/// A disc's rigidity.
pub fn disc(centre: P2, radius: f64) -> impl Fn(P2) -> f64 + Copy {
    move |p| f64::from(u8::from((p[0] - centre[0]).hypot(p[1] - centre[1]) < radius))
}

/// Points of a lattice within the sheet.
pub fn lattice(n: usize) -> Vec<P2> {
    (0..n * n).map(|k| [k % n, k / n].map(|m| (m as f64 + 0.5) / n as f64)).collect()
}
