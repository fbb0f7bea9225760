//! Cuts without width inside a chart: two borders with the same UVs, such as lips that are all but closed. Whatever the
//! pose does to them, no node crosses one, wherever it runs: on lines of the grid, between them, across them, and where
//! it ends or meets another.

use vrtm::{Device, Quality};
use vrtm_testkit::Lab as _;
use vrtm_testkit::{Maps, Model, devices, options};

/// Quads on a side of the sheet; two triangles each.
const QUADS: usize = 32;
/// Cells on a side of the grid: four per quad.
const GRID: usize = 128;

/// A straight cut from one vertex of the sheet to another, along edges of the mesh.
#[derive(Clone, Copy, Debug)]
struct Cut {
    from: [usize; 2],
    to: [usize; 2],
}

impl Cut {
    /// The vertices between both ends.
    fn between(self) -> impl Iterator<Item = [usize; 2]> {
        let way = [0, 1].map(|c| self.to[c] as i64 - self.from[c] as i64);
        let steps = way[0].abs().max(way[1].abs());
        (1..steps).map(move |k| [0, 1].map(|c| (self.from[c] as i64 + k * way[c] / steps) as usize))
    }

    /// Positive to the left of the line through the cut, for a point in quads.
    fn side(self, p: [f64; 2]) -> f64 {
        let [a, b] = [self.from, self.to].map(|p| p.map(|x| x as f64));
        (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    }

    /// Position of the point's foot on the line: 0 at one end of the cut, 1 at the other.
    fn along(self, p: [f64; 2]) -> f64 {
        let [a, b] = [self.from, self.to].map(|p| p.map(|x| x as f64));
        let d = [b[0] - a[0], b[1] - a[1]];
        (d[0] * (p[0] - a[0]) + d[1] * (p[1] - a[1])) / (d[0] * d[0] + d[1] * d[1])
    }

    /// True if the way from `p` to `q` meets the cut between its ends.
    fn is_crossed(self, p: [f64; 2], q: [f64; 2]) -> bool {
        let (s, t) = (self.side(p), self.side(q));
        if s * t >= 0.0 {
            return false;
        }
        let meeting = [0, 1].map(|c| p[c] + (q[c] - p[c]) * s / (s - t));
        (1e-6..1.0 - 1e-6).contains(&self.along(meeting))
    }
}

/// A unit sheet with cuts, whose sides lie a little apart at rest and far apart in the pose, and with discs of
/// rigidity. Its UVs begin at `shift` cells and are scaled so that they fit.
fn sheet(cuts: &[Cut], shift: f64) -> Model {
    let at = |[i, j]: [usize; 2]| j * (QUADS + 1) + i;
    let place = |v: usize| [v % (QUADS + 1), v / (QUADS + 1)].map(|x| x as f32 / QUADS as f32);
    let count = (QUADS + 1) * (QUADS + 1);
    let mut rest: Vec<[f32; 3]> = (0..count).map(|v| [place(v)[0], place(v)[1], 0.0]).collect();
    let mut pose: Vec<[f32; 3]> = rest.iter().map(|p| [p[0] * 1.2, p[1], 0.0]).collect();
    let scale = if shift == 0.0 { 1.0 } else { 0.9 };
    let uvs = (0..count).map(|v| place(v).map(|x| x * scale + shift as f32 / GRID as f32)).collect();
    let mut faces = Vec::new();
    for j in 0..QUADS {
        for i in 0..QUADS {
            let [a, b, c, d] = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(at);
            faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    let uv_faces = faces.clone();
    for cut in cuts {
        let way = [0, 1].map(|c| cut.to[c] as f64 - cut.from[c] as f64);
        let length = way[0].hypot(way[1]);
        for p in cut.between() {
            let (old, new) = (at(p), rest.len());
            let open = 0.05 * (std::f64::consts::PI * cut.along(p.map(|x| x as f64))).sin();
            rest.push(rest[old]);
            rest[new][2] = 1e-3;
            pose.push(pose[old]);
            for (c, away) in [-way[1], way[0]].into_iter().enumerate() {
                pose[new][c] += (open * away / length) as f32;
                pose[old][c] -= (open * away / length) as f32;
            }
            for (face, uv_face) in faces.iter_mut().zip(&uv_faces) {
                let middle = [0, 1].map(|c| {
                    uv_face.iter().map(|&v| f64::from(place(v)[c])).sum::<f64>() / 3.0 * QUADS as f64
                });
                if cut.side(middle) > 0.0 {
                    face.iter_mut().filter(|v| **v == old).for_each(|v| *v = new);
                }
            }
        }
    }
    let disc = |k: usize| {
        let [x, y] = [k % GRID, GRID - 1 - k / GRID].map(|x| (x % 16) as f64 + 0.5 - 8.0);
        if x * x + y * y < 30.0 { 255 } else { 0 }
    };
    let rigidity = (0..GRID * GRID).map(disc).collect();
    Model {
        name: "cut sheet".into(),
        rest,
        face_counts: vec![3; faces.len()],
        indices: faces.into_flattened().into_iter().map(|v| v as u32).collect(),
        uvs,
        uv_indices: uv_faces.into_flattened().into_iter().map(|v| v as u32).collect(),
        frames: vec![pose],
        maps: vec![Maps { udim: 1001, width: GRID as u32, height: GRID as u32, rigidity, mask: None }],
        ..Model::default()
    }
}

/// A sheet with two cuts between lines of the grid, which meet.
pub fn small() -> Model {
    let cut = |from: [usize; 2], to: [usize; 2]| Cut { from, to };
    sheet(&[cut([8, 16], [24, 16]), cut([16, 16], [16, 28])], 6.3)
}

/// The nodes that move, and those that cross a cut or lie on one and move.
fn moved_and_crossing(device: &Device, cuts: &[Cut], shift: f64) -> (usize, usize) {
    let model = sheet(cuts, shift);
    let asset = model.solved(device, GRID as u32, 1, &options(Quality::Normal));
    assert_eq!(asset.info().charts, 1);
    let scale = if shift == 0.0 { 1.0 } else { 0.9 };
    let in_quads = |p: [f64; 2]| p.map(|x| (x - shift) / scale / GRID as f64 * QUADS as f64);
    let u = asset.displacements(0).unwrap();
    let (mut moved, mut crossing) = (0, 0);
    for (n, u) in u.iter().enumerate().filter(|(_, u)| **u != [0.0; 2]) {
        let node = [n % (GRID + 1), n / (GRID + 1)].map(|x| x as f64);
        let (p, q) = (in_quads(node), in_quads([0, 1].map(|c| node[c] + f64::from(u[c]))));
        let bad = |cut: &Cut| {
            let on_it = cut.side(p) == 0.0 && (0.0..=1.0).contains(&cut.along(p));
            on_it || cut.is_crossed(p, q)
        };
        moved += 1;
        crossing += usize::from(cuts.iter().any(bad));
    }
    (moved, crossing)
}

#[test]
fn no_node_crosses_a_cut() {
    let cut = |from: [usize; 2], to: [usize; 2]| Cut { from, to };
    let horizontal = cut([8, 16], [24, 16]);
    let cases: [(&str, Vec<Cut>); 7] = [
        ("along u", vec![horizontal]),
        ("along u, the other way", vec![cut([24, 16], [8, 16])]),
        ("along v", vec![cut([16, 6], [16, 26])]),
        ("diagonal", vec![cut([8, 8], [24, 24])]),
        ("open at one end", vec![cut([0, 16], [20, 16])]),
        ("a T", vec![horizontal, cut([16, 16], [16, 28])]),
        ("a cross", vec![horizontal, cut([16, 17], [16, 28]), cut([16, 15], [16, 4])]),
    ];
    for device in devices() {
        for (name, cuts) in &cases {
            // On lines of the grid, and between them.
            for shift in [0.0, 6.3] {
                let (moved, crossing) = moved_and_crossing(&device, cuts, shift);
                println!("{name}, shifted by {shift}: {moved} nodes move, {crossing} cross");
                assert_eq!(crossing, 0, "{name}, shifted by {shift}");
                assert!(moved > 5000, "{name}: {moved}");
            }
        }
    }
}
