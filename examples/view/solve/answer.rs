//! What a solve gives back: everything that has to be drawn together.

use std::sync::Arc;

use vrtm::{Asset, AssetReport, FetchKind, ImageViewMut, Origin, StrainReport, TileReport};

use super::inbox::Request;

/// Most texels per side of a map that is drawn with; a finer grid is solved all the same.
const MOST: u32 = 1024;

/// A solved frame.
#[derive(Clone)]
pub struct Answer {
    pub request: Request,
    pub positions: Arc<Vec<[f32; 3]>>,
    pub normals: Arc<Vec<[f32; 3]>>,
    /// For each tile.
    pub tiles: Vec<Solved>,
    pub report: AssetReport,
    /// Milliseconds of the solve without building grids and measuring, of building grids, of measuring, and of the
    /// fetches.
    pub solve_ms: f64,
    pub build_ms: f64,
    pub measure_ms: f64,
    pub fetch_ms: f64,
}

/// A tile's result.
#[derive(Clone)]
pub struct Solved {
    pub maps: Arc<Maps>,
    pub report: TileReport,
}

/// The redirection to draw with and to paint through, and the warp. Rows run from v = 0 upward.
pub struct Maps {
    pub size: [u32; 2],
    /// The redirection minus the texel's own centre.
    pub delta: Vec<[f32; 2]>,
    /// The warp at the nodes of a grid of `size` cells.
    pub warp: Vec<[f32; 2]>,
}

impl Maps {
    /// Nothing moves.
    pub fn identity() -> Maps {
        Maps {
            size: [1, 1],
            delta: vec![[0.0; 2]],
            warp: vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]],
        }
    }

    /// # Errors
    /// Those of vrtm.
    pub fn fetch(asset: &Asset, tile: usize, report: &TileReport) -> vrtm::Result<Maps> {
        let size = report.grid.map(|cells| cells.min(MOST));
        let image = |kind, [width, height]: [u32; 2]| {
            let mut texels = vec![[0.0f32; 2]; width as usize * height as usize];
            let view = ImageViewMut::from_texels("image", &mut texels, [width, height])?;
            asset.tile(tile).fetch(kind, &mut view.with_origin(Origin::Bottom))?;
            vrtm::Result::Ok(texels)
        };
        let delta = image(FetchKind::RedirectionDelta, size)?;
        let warp = image(FetchKind::Warp, size.map(|n| n + 1))?;
        Ok(Maps { size, delta, warp })
    }

    /// The UV of the texture that is seen at a UV of the surface.
    pub fn redirected(&self, uv: [f32; 2]) -> [f32; 2] {
        let [x, y] =
            [0, 1].map(|c| ((uv[c] * self.size[c] as f32).max(0.0) as usize).min(self.size[c] as usize - 1));
        let delta = self.delta[y * self.size[0] as usize + x];
        [0, 1].map(|c| uv[c] + delta[c])
    }

    /// The UV of the surface at which a UV of the texture is seen.
    pub fn warped(&self, uv: [f32; 2]) -> [f32; 2] {
        let at = [0, 1].map(|c| uv[c].clamp(0.0, 1.0) * self.size[c] as f32);
        let low = [0, 1].map(|c| (at[c] as u32).min(self.size[c] - 1));
        let t = [0, 1].map(|c| at[c] - low[c] as f32);
        let node = |x: u32, y: u32| self.warp[(y * (self.size[0] + 1) + x) as usize];
        let [a, b] = [node(low[0], low[1]), node(low[0] + 1, low[1])];
        let [c, d] = [node(low[0], low[1] + 1), node(low[0] + 1, low[1] + 1)];
        // Two triangles per cell, split by the diagonal from its corner of least u and v.
        [0, 1].map(|k| {
            if t[0] > t[1] {
                a[k] + (b[k] - a[k]) * t[0] + (d[k] - b[k]) * t[1]
            } else {
                a[k] + (d[k] - c[k]) * t[0] + (c[k] - a[k]) * t[1]
            }
        })
    }
}

/// Strain over all tiles: root of the mean square, and 95th percentile (the largest of any tile), before and after.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strain {
    pub edges: u64,
    pub rms: [f32; 2],
    pub p95: [f32; 2],
    /// Painted features, and how many of them are worse than without the warp.
    pub features: [u32; 2],
}

impl Answer {
    /// `None` if nothing rigid was measured.
    pub fn strain(&self) -> Option<Strain> {
        let reports = || self.tiles.iter().filter_map(|tile| tile.report.strain.as_ref());
        let all = reports().map(|s| (s.segments, [s.before.rms, s.after.rms], [s.before.p95, s.after.p95]));
        let features = [|s: &StrainReport| s.features, |s: &StrainReport| s.features_worse]
            .map(|count| reports().map(count).sum());
        Strain::of(all).map(|strain| Strain { features, ..strain })
    }
}

impl Strain {
    fn of(tiles: impl Iterator<Item = (u64, [f32; 2], [f32; 2])>) -> Option<Strain> {
        let (mut all, mut squares) = (Strain::default(), [0.0f64; 2]);
        for (edges, rms, p95) in tiles {
            all.edges += edges;
            for k in 0..2 {
                squares[k] += edges as f64 * f64::from(rms[k]).powi(2);
                all.p95[k] = all.p95[k].max(p95[k]);
            }
        }
        all.rms = squares.map(|sum| (sum / all.edges as f64).sqrt() as f32);
        (all.edges > 0).then_some(all)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tiles_count_by_their_edges() {
        let tiles = [(300, [0.0, 0.1], [0.5, 0.2]), (100, [0.4, 0.1], [0.1, 0.3]), (0, [9.0; 2], [0.0; 2])];
        let all = Strain::of(tiles.into_iter()).expect("edges");
        assert_eq!((all.edges, all.p95), (400, [0.5, 0.3]));
        assert!((all.rms[0] - 0.2).abs() < 1e-6 && (all.rms[1] - 0.1).abs() < 1e-6, "{:?}", all.rms);
        assert_eq!(Strain::of(std::iter::empty()), None);
    }
}
