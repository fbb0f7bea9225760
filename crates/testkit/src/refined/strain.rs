//! Strain inside rigid features by each way to redirect: the mesh's corner UVs, refined ones, and the map. Measured
//! from what a host gets: segments between neighbouring texel centres of the rigidity map, both rigid, lie somewhere on
//! the posed surface in each case; their lengths there are compared with those at rest. Those count that the warp
//! moves.

use vrtm::{Asset, RefinementSettings};

use super::Refined;
use super::truth::visit;
use crate::{Model, Warp, barycentric};

/// Place in space and chart of each texel centre of the texture. `None` if nothing shows it.
type Places = Vec<Option<([f64; 3], u32)>>;

/// The strain of one frame of a model's first tile.
pub struct Measured<'a> {
    model: &'a Model,
    pose: &'a [[f32; 3]],
    charts: Vec<u32>,
    size: usize,
    at_rest: Places,
    /// True if the warp moves the texel's centre.
    moves: Vec<bool>,
    whole: Refined,
}

impl<'a> Measured<'a> {
    pub fn new(model: &'a Model, frame: usize, asset: &Asset, warp: &Warp) -> Measured<'a> {
        let settings = RefinementSettings { max_triangles: Some(1), ..RefinementSettings::default() };
        let whole = Refined::of(&asset.refine(&settings).unwrap());
        assert_eq!(whole.vertex_sources.len(), model.rest.len());
        let (charts, size) = (charts(model), model.maps[0].width as usize);
        let pose = &model.frames[frame - 1];
        let moves = (0..size * size).map(|texel| {
            let cells = [warp.nx, warp.ny].map(|n| n as f64 / size as f64);
            let at = [(texel % size) as f64 + 0.5, (texel / size) as f64 + 0.5];
            let at = [0, 1].map(|k| at[k] * cells[k]);
            warp.at(at) != at
        });
        let moves = moves.collect();
        let mut measured = Measured { model, pose, charts, size, at_rest: Vec::new(), moves, whole };
        measured.at_rest = measured.places(&measured.whole, &measured.whole.uvs, &model.rest);
        measured
    }

    /// With the mesh's own UVs.
    pub fn before(&self) -> f64 {
        self.rms(&self.places(&self.whole, &self.whole.uvs, self.pose))
    }

    /// With the redirected corner UVs of the mesh.
    pub fn by_corners(&self) -> f64 {
        self.by_refined(&self.whole)
    }

    pub fn by_refined(&self, refined: &Refined) -> f64 {
        self.rms(&self.places(refined, &refined.redirected, self.pose))
    }

    /// With the map: where it holds a texel's centre, the warp of that centre lies.
    pub fn by_map(&self, warp: &Warp) -> f64 {
        let locator = Locator::new(self);
        let places = self.at_rest.iter().enumerate().map(|(texel, home)| {
            let chart = (*home)?.1;
            let centre = [texel % self.size, texel / self.size].map(|x| (x as f64 + 0.5) / self.size as f64);
            let cells = [warp.nx, warp.ny].map(|n| n as f64);
            let moved = warp.at([0, 1].map(|k| centre[k] * cells[k]));
            Some((locator.find([0, 1].map(|k| moved[k] / cells[k]), chart)?, chart))
        });
        self.rms(&places.collect::<Vec<_>>())
    }

    /// A texel that several faces show is the first one's.
    fn places(&self, refined: &Refined, uvs: &[[f32; 2]], pose: &[[f32; 3]]) -> Places {
        let positions = refined.positions(pose);
        let mut places: Places = vec![None; self.size * self.size];
        for (f, face) in refined.faces().enumerate() {
            let chart = self.charts[refined.face_sources[f] as usize];
            for triangle in refined.triangles(face, false) {
                let uv = triangle.map(|c| uvs[c].map(f64::from));
                let corners = triangle.map(|c| positions[refined.corner_vertices[c] as usize]);
                visit(uv, self.size, |x, y, l| {
                    places[y * self.size + x].get_or_insert((interpolated(corners, l), chart));
                });
            }
        }
        places
    }

    fn rms(&self, places: &Places) -> f64 {
        let (size, map) = (self.size, &self.model.maps[0]);
        // The map's first row is at v = 1.
        let rigid = |x: usize, y: usize| map.rigidity[(size - 1 - y) * size + x] > 127;
        let (mut sum, mut count) = (0.0, 0);
        for y in 0..size - 1 {
            for x in 1..size - 1 {
                for (i, j) in [(x + 1, y), (x, y + 1), (x + 1, y + 1), (x - 1, y + 1)] {
                    let (a, b) = (y * size + x, j * size + i);
                    let both = |places: &Places| places[a].zip(places[b]).filter(|(p, q)| p.1 == q.1);
                    if !rigid(x, y) || !rigid(i, j) || !(self.moves[a] || self.moves[b]) {
                        continue;
                    }
                    if let (Some(rest), Some(posed)) = (both(&self.at_rest), both(places)) {
                        let [rest, posed] = [rest, posed].map(|(p, q)| distance(p.0, q.0));
                        sum += (posed / rest - 1.0).powi(2);
                        count += 1;
                    }
                }
            }
        }
        assert!(count > 1000, "{}: {count} segments", self.model.name);
        (sum / f64::from(count)).sqrt()
    }
}

/// The chart of each face: faces that share UVs are in one.
fn charts(model: &Model) -> Vec<u32> {
    let mut parents: Vec<usize> = (0..model.uvs.len()).collect();
    fn root(parents: &mut [usize], mut k: usize) -> usize {
        while parents[k] != k {
            parents[k] = parents[parents[k]];
            k = parents[k];
        }
        k
    }
    for face in model.faces() {
        let first = root(&mut parents, model.uv_indices[face.start] as usize);
        for c in face {
            let other = root(&mut parents, model.uv_indices[c] as usize);
            parents[other] = first;
        }
    }
    model.faces().map(|face| root(&mut parents, model.uv_indices[face.start] as usize) as u32).collect()
}

/// Finds the place of a UV on the posed mesh.
struct Locator<'a> {
    of: &'a Measured<'a>,
    positions: Vec<[f64; 3]>,
    /// Per square of a coarse lattice, the triangles that may meet it, and their charts.
    squares: Vec<Vec<([usize; 3], u32)>>,
}

const SQUARES: usize = 128;

impl<'a> Locator<'a> {
    fn new(of: &'a Measured<'a>) -> Locator<'a> {
        let mut squares = vec![Vec::new(); SQUARES * SQUARES];
        let whole = &of.whole;
        for (f, face) in whole.faces().enumerate() {
            for triangle in whole.triangles(face, false) {
                let span = |k: usize| {
                    let at = triangle.map(|c| f64::from(whole.uvs[c][k]) * SQUARES as f64);
                    let low = at.iter().fold(f64::INFINITY, |m, &x| m.min(x)) - 0.5;
                    let high = at.iter().fold(0.0f64, |m, &x| m.max(x)) + 0.5;
                    low.max(0.0) as usize..=(high as usize).min(SQUARES - 1)
                };
                for y in span(1) {
                    span(0).for_each(|x| {
                        squares[y * SQUARES + x].push((triangle, of.charts[whole.face_sources[f] as usize]))
                    });
                }
            }
        }
        Locator { of, positions: whole.positions(of.pose), squares }
    }

    fn find(&self, uv: [f64; 2], chart: u32) -> Option<[f64; 3]> {
        let [x, y] = uv.map(|x| ((x * SQUARES as f64) as usize).min(SQUARES - 1));
        let whole = &self.of.whole;
        let inside = self.squares[y * SQUARES + x].iter().filter(|t| t.1 == chart).map(|(triangle, _)| {
            let l = barycentric(&triangle.map(|c| whole.uvs[c].map(f64::from)), uv);
            (l.into_iter().fold(f64::INFINITY, f64::min), triangle, l)
        });
        let best = inside.filter(|one| one.0 > -0.01).max_by(|p, q| p.0.total_cmp(&q.0))?;
        Some(interpolated(best.1.map(|c| self.positions[whole.corner_vertices[c] as usize]), best.2))
    }
}

fn interpolated(corners: [[f64; 3]; 3], l: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|axis| (0..3).map(|k| l[k] * corners[k][axis]).sum())
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt()
}
