//! A sheet of two charts with eight painted discs, in 48 poses: a preview in which the newest pose wins, then each pose
//! exactly, with its map and a stud. README.md says what is printed.

use std::sync::{Arc, mpsc};
use std::thread;

use vrtm::{
    Asset, Backend, Bind, Carried, CarrierSettings, Control, Device, DeviceSettings, ErrorKind, Fetch,
    FetchKind, ImageView, ImageViewMut, MeshSource, Quality, SolveOptions, SolveRequest, Strided, StridedMut,
    TileSettings, UvSource,
};

const POSES: usize = 48;
const CELLS: usize = 20;
const LINE: usize = CELLS + 1;
const TEXELS: usize = 128;
const RADIUS: f64 = 0.15;

type Point = [f64; 3];

fn distance(a: Point, b: Point) -> f64 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum::<f64>().sqrt()
}

/// The place on the sheet at rest, of 2 x 1, that has a UV: each half is a chart.
fn at_rest([u, v]: [f64; 2]) -> Point {
    let chart = if u < 0.5 { 0.0 } else { 1.0 };
    [chart + (u - 0.04 - 0.48 * chart) / 0.44, (v - 0.28) / 0.44, 0.0]
}

fn posed([x, y, _]: Point, pose: usize) -> Point {
    let s = pose as f64 / (POSES as f64 - 1.0);
    [x + 0.15 * s * x * (x - 1.0), y - 0.2 * s * x * y * (1.0 - y), 0.3 * s * x * (2.0 - x)]
}

/// True within so many units from the centre of the nearest of the four discs of a chart.
fn in_disc(uv: [f64; 2], within: f64) -> bool {
    let [x, y, _] = at_rest(uv);
    let x = (x - if uv[0] < 0.5 { 0.0 } else { 1.0 } - 0.5).abs() - 0.25;
    let y = (y - 0.5).abs() - 0.25;
    x * x + y * y < within * within
}

fn positions(pose: usize) -> Vec<[f32; 3]> {
    let at = |k: usize| (k % LINE) as f64 / CELLS as f64;
    let rest = |k: usize| [(k / (LINE * LINE)) as f64 + at(k), at(k / LINE), 0.0];
    (0..2 * LINE * LINE).map(|k| posed(rest(k), pose).map(|x| x as f32)).collect()
}

/// The UV of the centre of a texel, the first row at v = 1.
fn centre(x: usize, y: usize) -> [f64; 2] {
    [(x as f64 + 0.5) / TEXELS as f64, 1.0 - (y as f64 + 0.5) / TEXELS as f64]
}

/// The RMS strain of the discs: lengths between neighbouring texels in the pose, over those of what they show.
fn strain(map: &[[f32; 2]], pose: usize) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for k in 0..(TEXELS - 1) * (TEXELS - 1) {
        let (x, y) = (k % (TEXELS - 1), k / (TEXELS - 1));
        for (dx, dy) in [(1, 0), (0, 1)] {
            let [a, b] = [y * TEXELS + x, (y + dy) * TEXELS + x + dx].map(|texel| map[texel].map(f64::from));
            if in_disc(a, 0.13) && in_disc(b, 0.13) {
                let [here, there] = [centre(x, y), centre(x + dx, y + dy)].map(|uv| posed(at_rest(uv), pose));
                sum += (distance(here, there) / distance(at_rest(a), at_rest(b)) - 1.0).powi(2);
                count += 1;
            }
        }
    }
    (sum / f64::from(count)).sqrt()
}

fn main() -> vrtm::Result<()> {
    let (mut indices, mut uvs) = (Vec::new(), Vec::new());
    for k in 0..2 * LINE * LINE {
        let (i, j, chart) = (k % LINE, k / LINE % LINE, k / (LINE * LINE));
        let part = |k: usize| 0.44 * k as f64 / CELLS as f64;
        uvs.push([0.04 + 0.48 * chart as f64 + part(i), 0.28 + part(j)].map(|x| x as f32));
        if i < CELLS && j < CELLS {
            indices.extend([k, k + 1, k + LINE + 1, k + LINE].map(|vertex| vertex as u32));
        }
    }
    let texels: Vec<[f64; 2]> = (0..TEXELS * TEXELS).map(|k| centre(k % TEXELS, k / TEXELS)).collect();
    let painted: Vec<u8> = texels.iter().map(|&uv| if in_disc(uv, RADIUS) { 255 } else { 0 }).collect();
    let own: Vec<[f32; 2]> = texels.iter().map(|uv| uv.map(|x| x as f32)).collect();

    let log = Some(Arc::new(|entry: &vrtm::LogEntry| eprintln!("{}", entry.message)) as vrtm::LogFn);
    let device = Device::new(&DeviceSettings { backend: Backend::Cpu, log, ..DeviceSettings::default() })?;
    let rest = positions(0);
    let source = MeshSource {
        positions: Strided::from_slice(&rest),
        face_counts: Some(&[4; 2 * CELLS * CELLS]),
        indices: &indices,
        uvs: UvSource { u: Strided::from_slice(&uvs), v: None, indices: Some(&indices) },
        ..MeshSource::default()
    };
    let mut asset = Asset::new(&device, &source)?;
    let size = [TEXELS as u32; 2];
    let tile = asset.find_tile(1001).expect("the UVs lie in the first tile");
    asset.tile_mut(tile).set_rigidity(Some(ImageView::from_texels("painted", &painted, size)?))?;
    asset.tile_mut(tile).set_settings(&TileSettings { grid: [Some(96); 2], ..TileSettings::default() })?;

    // A stud: its tip over the middle of the first disc, and two places on its rim.
    let at = [[0.15f32, 0.39], [0.2, 0.39], [0.15, 0.44]];
    let stud = asset.carrier(&CarrierSettings {
        heights: Some(Strided::from_slice(&[0.1f32, 0.0, 0.0])),
        ..CarrierSettings::new(Bind::Uv { uvs: Strided::from_slice(&at), layers: None })
    })?;

    // As fast as the mouse moves: each pose takes the place of the one before, on a thread that has the asset.
    let (send, received) = mpsc::channel::<(Vec<[f32; 3]>, Arc<Control>)>();
    thread::scope(|scope| {
        let solver = scope.spawn(|| {
            for (positions, control) in received {
                let options = SolveOptions { quality: Quality::Draft, ..SolveOptions::default() };
                let (positions, control) = (Strided::from_slice(&positions), Some(control));
                let request = SolveRequest { positions, options, control, ..SolveRequest::default() };
                asset
                    .run(&request, &mut [])
                    .or_else(|e| if e.kind == ErrorKind::Cancelled { Ok(()) } else { Err(e) })?;
            }
            Ok(())
        });
        let mut last = Arc::new(Control::new());
        for pose in 0..POSES {
            last.cancel();
            last = Arc::new(Control::new());
            let _ = send.send((positions(pose), last.clone()));
        }
        drop(send);
        solver.join().expect("it does not panic")
    })?;
    println!("preview {:.4}", asset.tile(tile).report()?.min_jacobian);

    for pose in 0..POSES {
        let (mut map, mut points) = (vec![[0.0f32; 2]; TEXELS * TEXELS], [[0.0f32; 3]; 3]);
        let image = ImageViewMut::from_texels("map", &mut map, size)?;
        let carried = Carried { positions: Some(StridedMut::from_slice(&mut points)), ..Carried::default() };
        let image = Fetch::Image { tile, kind: FetchKind::Redirection, image };
        let mut fetches = [image, Fetch::Carried { carrier: &stud, carried }];
        asset.redirect(Strided::from_slice(&positions(pose)), &SolveOptions::default(), &mut fetches)?;
        if pose % 8 == 0 || pose == POSES - 1 {
            let [tip, rim, _] = points.map(|point| point.map(f64::from));
            let (before, after) = (strain(&own, pose), strain(&map, pose));
            let ([u, v], [x, y, z]) = (map[78 * TEXELS + 19], tip);
            print!("{pose:2}  {before:.4} {after:.4}  {u:.4} {v:.4}  {x:.4} {y:.4} {z:.4}");
            println!("  {:.4}", distance(tip, rim));
        }
    }
    Ok(())
}
