//! Second differences over frames of a pose, in units that can stand beside those of the warp.

use crate::model::Model;

pub type Points = Vec<[f64; 3]>;

/// Size of values: the root of the mean square, the bound of 99.9 %, the largest, and the place of that.
#[derive(Clone, Copy, Debug, Default)]
pub struct Spread {
    pub rms: f64,
    pub p999: f64,
    pub max: f64,
    pub at: usize,
}

impl Spread {
    /// Of values, each with the number that `at` is to tell.
    pub fn of(values: impl IntoIterator<Item = (usize, f64)>) -> Spread {
        let mut values: Vec<(usize, f64)> = values.into_iter().collect();
        let sum: f64 = values.iter().map(|(_, x)| x * x).sum();
        let rms = (sum / values.len().max(1) as f64).sqrt();
        let Some(&(at, max)) = values.iter().max_by(|a, b| a.1.total_cmp(&b.1)) else {
            return Spread::default();
        };
        let rank = values.len() - 1 - values.len() / 1000;
        let p999 = values.select_nth_unstable_by(rank, |a, b| a.1.total_cmp(&b.1)).1.1;
        Spread { rms, p999, max, at }
    }

    /// The larger of each, of two frames.
    pub fn larger(self, other: Spread) -> Spread {
        let at = if other.max > self.max { other.at } else { self.at };
        Spread {
            rms: self.rms.max(other.rms),
            p999: self.p999.max(other.p999),
            max: self.max.max(other.max),
            at,
        }
    }
}

pub fn length(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|c| a[c] - b[c])
}

/// Length of a cell at rest around each vertex; 0 at a vertex without faces.
pub fn cells(model: &Model, grid: u32) -> Vec<f64> {
    let mut areas = vec![[0.0; 2]; model.rest.len()];
    let rest = crate::model::doubles(&model.rest);
    let n = f64::from(grid);
    for face in model.faces() {
        let (p, uv): (Vec<_>, Vec<_>) = face
            .clone()
            .map(|c| {
                let uv = model.uvs[model.uv_indices[c] as usize];
                (rest[model.indices[c] as usize], uv.map(|x| f64::from(x) * n))
            })
            .unzip();
        for k in 1..p.len() - 1 {
            let [a, b] = [k, k + 1].map(|k| difference(p[k], p[0]));
            let [s, t] = [k, k + 1].map(|k| [0, 1].map(|c| uv[k][c] - uv[0][c]));
            let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            let area = [length(&cross), (s[0] * t[1] - s[1] * t[0]).abs()];
            for c in face.clone() {
                let sum = &mut areas[model.indices[c] as usize];
                (0..2).for_each(|k| sum[k] += area[k]);
            }
        }
    }
    areas.iter().map(|[space, uv]| if *uv > 0.0 { (space / uv).sqrt() } else { 0.0 }).collect()
}

/// Second difference of three poses at each vertex, in cells as `cells` gives them.
pub fn of_positions(cells: &[f64], poses: [&Points; 3]) -> Spread {
    let vertices = (0..cells.len()).filter(|&v| cells[v] > 0.0);
    Spread::of(vertices.map(|v| {
        let d = [0, 1, 2].map(|c| poses[2][v][c] - 2.0 * poses[1][v][c] + poses[0][v][c]);
        (v, length(&d) / cells[v])
    }))
}
