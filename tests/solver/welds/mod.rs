//! Which corners of faces are one: by the host's vertices, by position with a tolerance, or not at all; and what a pose
//! that tears welded vertices apart does.

mod noise;
mod torn;

use vrtm::{Asset, Device, Quality, Weld, WeldBy};
use vrtm_testkit::{Maps, Model, options};

/// Quads on a side of the unit sheet.
const QUADS: usize = 32;
/// Cells on a side of the grid: eight per quad.
const GRID: usize = 256;

fn by(by: WeldBy) -> Weld {
    Weld { by, ..Weld::default() }
}

/// A unit sheet of quads with UVs equal to its positions, one `vt` per vertex, stretched along u by the pose, with
/// discs of rigidity.
fn sheet(quads: usize) -> Model {
    let count = (quads + 1) * (quads + 1);
    let place = |v: usize| [v % (quads + 1), v / (quads + 1)].map(|x| x as f32 / quads as f32);
    let rest: Vec<[f32; 3]> = (0..count).map(|v| [place(v)[0], place(v)[1], 0.0]).collect();
    let indices = vrtm_testkit::quads([quads; 2], 0);
    let disc = |k: usize| {
        let [x, y] = [k % GRID, GRID - 1 - k / GRID].map(|x| (x % 32) as f64 + 0.5 - 16.0);
        if x * x + y * y < 120.0 { 255 } else { 0 }
    };
    let rigidity = (0..GRID * GRID).map(disc).collect();
    Model {
        name: "sheet".into(),
        frames: vec![rest.iter().map(|p| [p[0] * 1.2, p[1], 0.3 * p[0] * p[1]]).collect()],
        face_counts: vec![4; quads * quads],
        uvs: (0..count).map(place).collect(),
        uv_indices: indices.clone(),
        indices,
        rest,
        maps: vec![Maps { udim: 1001, width: GRID as u32, height: GRID as u32, rigidity, mask: None }],
        ..Model::default()
    }
}

/// The same with a slit along v = 0.5 from u = 0.25 to u = 0.75: its vertices are doubled, at equal positions with
/// equal UVs, and the pose opens it. `two_vt`: the UVs are doubled, too. Returns the doubled vertices, as (below,
/// above).
pub fn slit(two_vt: bool) -> (Model, Vec<[u32; 2]>) {
    let mut model = sheet(QUADS);
    let at = |i: usize| (QUADS / 2 * (QUADS + 1) + i) as u32;
    let mut doubled = Vec::new();
    for i in QUADS / 4 + 1..3 * QUADS / 4 {
        let (old, new) = (at(i), model.rest.len() as u32);
        doubled.push([old, new]);
        model.rest.push(model.rest[old as usize]);
        let along = (i - QUADS / 4) as f64 / (QUADS / 2) as f64;
        let open = 0.05 * (std::f64::consts::PI * along).sin() as f32;
        let mut above = model.frames[0][old as usize];
        above[1] += open;
        model.frames[0].push(above);
        model.frames[0][old as usize][1] -= open;
        let new_uv = if two_vt { model.uvs.len() as u32 } else { old };
        if two_vt {
            model.uvs.push(model.uvs[old as usize]);
        }
        // The faces above are those of the rows from the middle on.
        for c in QUADS * QUADS / 2 * 4..model.indices.len() {
            if model.indices[c] == old {
                (model.indices[c], model.uv_indices[c]) = (new, new_uv);
            }
        }
    }
    (model, doubled)
}

/// Gives every face vertices of its own, as exporters of games do.
fn unwelded(model: &Model) -> Model {
    let spread = |points: &Vec<[f32; 3]>| model.indices.iter().map(|&v| points[v as usize]).collect();
    let corners: Vec<u32> = (0..model.indices.len() as u32).collect();
    Model {
        rest: spread(&model.rest),
        frames: model.frames.iter().map(spread).collect(),
        uvs: model.uv_indices.iter().map(|&k| model.uvs[k as usize]).collect(),
        indices: corners.clone(),
        uv_indices: corners,
        ..model.clone()
    }
}

/// Gives every corner a UV of its own, moved by `f` (of the corner and the UV).
fn with_uvs(model: &Model, f: impl Fn(usize, f32) -> f32) -> Model {
    let moved = |c: usize, k: u32| model.uvs[k as usize].map(|x| f(c, x));
    Model {
        uvs: model.uv_indices.iter().enumerate().map(|(c, &k)| moved(c, k)).collect(),
        uv_indices: (0..model.indices.len() as u32).collect(),
        ..model.clone()
    }
}

fn solved(model: &Model, device: &Device) -> Asset {
    model.solved(device, GRID as u32, 1, &options(Quality::Normal))
}

fn energy(asset: &Asset) -> [f64; 2] {
    let report = asset.tile(0).report().unwrap();
    [report.energy_before, report.energy]
}

/// A few nodes at the rim of a noisy edge may change sides; the energies of the whole are the same.
fn assert_near(a: [f64; 2], b: [f64; 2], tolerance: f64, what: &str) {
    for (a, b) in a.into_iter().zip(b) {
        assert!((a / b - 1.0).abs() < tolerance, "{what}: {a} {b}");
    }
}
