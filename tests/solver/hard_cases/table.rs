//! The table of hard cases: a sheet, or several pieces, with extreme UVs, poses, maps or options.

use vrtm::{Overlap, Quality, SolveOptions, TileSettings};

use super::{Case, Expect, Map, Points};

const GRID: usize = 64;
/// The sheet covers the UVs from this value to 1 minus this value.
const MARGIN: f64 = 0.04;

/// Discs, 6 by 6.
fn discs(n: usize) -> Map {
    Map::new([n, n], |x, y| {
        let off = |k: usize| (6.0 * (k as f64 + 0.5) / n as f64).fract() - 0.5;
        if off(x).powi(2) + off(y).powi(2) < 0.09 { 1.0 } else { 0.0 }
    })
}

fn all(value: f32) -> Map {
    Map::new([1, 1], |_, _| value)
}

fn at(fraction: f64) -> f64 {
    MARGIN + (1.0 - 2.0 * MARGIN) * fraction
}

/// Two triangles per quad, with the opposite winding where `flipped`.
fn quads(n: [usize; 2], flipped: impl Fn(usize, usize) -> bool) -> Vec<u32> {
    let node = |i: usize, j: usize| (j * (n[0] + 1) + i) as u32;
    let mut triangles = Vec::new();
    for j in 0..n[1] {
        for i in 0..n[0] {
            let mut six = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j), (i + 1, j + 1), (i, j + 1)]
                .map(|(i, j)| node(i, j));
            if flipped(i, j) {
                six.swap(1, 2);
                six.swap(4, 5);
            }
            triangles.extend(six);
        }
    }
    triangles
}

/// A sheet of n by n quads, flat at rest, on a grid of 64 cells with discs.
fn fine(name: &'static str, n: usize, expect: Expect, pose: impl Fn([f64; 3]) -> [f64; 3]) -> Case {
    let points = |f: &dyn Fn(f64, f64) -> [f64; 3]| -> Points {
        (0..(n + 1) * (n + 1))
            .map(|k| f(at((k % (n + 1)) as f64 / n as f64), at((k / (n + 1)) as f64 / n as f64)))
            .collect()
    };
    let rest = points(&|x, y| [x, y, 0.0]);
    Case {
        name,
        triangles: quads([n, n], |_, _| false),
        uvs: rest.iter().map(|p| [p[0] as f32, p[1] as f32]).collect(),
        poses: vec![rest.iter().map(|&p| pose(p)).collect()],
        rest,
        rigidity: Some(discs(GRID)),
        mask: None,
        settings: TileSettings { grid: [Some(GRID as u32); 2], ..TileSettings::default() },
        options: SolveOptions::default(),
        expect,
    }
}

fn sheet(name: &'static str, expect: Expect, pose: impl Fn([f64; 3]) -> [f64; 3]) -> Case {
    fine(name, 16, expect, pose)
}

fn squash(fraction: f64) -> impl Fn([f64; 3]) -> [f64; 3] {
    move |[x, y, z]| [0.5 + (x - 0.5) * fraction, y, z]
}

/// Compressed toward the middle, and lifted there.
fn bulge([x, y, z]: [f64; 3]) -> [f64; 3] {
    let t = (1.0 - ((x - 0.5).powi(2) + (y - 0.5).powi(2)) / 0.2).max(0.0);
    [x, y, z + 0.35 * t * t]
}

/// The bulge of a sheet that is modified first.
fn bulged(name: &'static str, expect: Expect, change: impl FnOnce(&mut Case)) -> Case {
    let mut case = sheet(name, expect, bulge);
    change(&mut case);
    case
}

/// The bulge with all positions, at rest and in the pose, translated.
fn moved(name: &'static str, expect: Expect, f: impl Fn([f64; 3]) -> [f64; 3]) -> Case {
    bulged(name, expect, |case| {
        for points in std::iter::once(&mut case.rest).chain(&mut case.poses) {
            points.iter_mut().for_each(|p| *p = f(*p));
        }
    })
}

/// Squares of `texels` texels a side, each of them a chart with one vertex in the middle, which the pose moves.
fn charts(name: &'static str, grid: u32, texels: f64, count: usize) -> Case {
    let per_row = (count as f64).sqrt().ceil() as usize;
    let (mut rest, mut pose, mut triangles) = (Points::new(), Points::new(), Vec::new());
    let cell = 1.0 / f64::from(grid);
    for k in 0..count {
        let first = rest.len() as u32;
        let low = [k % per_row, k / per_row]
            .map(|k| (k as f64 + 0.3) * cell * (texels + 1.0).max(f64::from(grid) / per_row as f64));
        for (s, t) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0), (0.5, 0.5)] {
            let p = [low[0] + s * texels * cell, low[1] + t * texels * cell, 0.0];
            rest.push(p);
            let shift = if s == 0.5 { 0.3 * texels * cell } else { 0.0 };
            pose.push([p[0] + shift, p[1], p[2] + 0.5 * shift]);
        }
        for i in 0..4 {
            triangles.extend([first + i, first + (i + 1) % 4, first + 4]);
        }
    }
    let uvs = rest.iter().map(|p| [p[0] as f32, p[1] as f32]).collect();
    let settings = TileSettings { grid: [Some(grid); 2], ..TileSettings::default() };
    let (rigidity, poses) = (Some(all(0.9)), vec![pose]);
    Case { triangles, uvs, rest, poses, rigidity, settings, ..sheet(name, Expect::Certified, |p| p) }
}

pub fn cases() -> Vec<Case> {
    use Expect::{Certified, Gain, Near, NoTile, Truncated};
    let mut list = vec![
        sheet("rest", Near(0.0), |p| p),
        sheet("squash to 40 %", Gain(0.9), squash(0.4)),
        sheet("squash to 10 %", Gain(1.0), squash(0.1)),
        sheet("squash to 1 %", Gain(1.0), squash(0.01)),
        sheet("collapse to a line", Certified, |[_, y, _]| [0.5, y, 0.0]),
        sheet("collapse to a point", Certified, |_| [0.5; 3]),
        sheet("half of it collapsed to a line", Certified, |[x, y, z]| [x.max(0.5), y, z]),
        bulged("everything rigid", Certified, |case| case.rigidity = Some(all(1.0))),
        bulged("nothing rigid", Near(0.0), |case| case.rigidity = Some(all(0.0))),
        bulged("no rigidity", Near(0.0), |case| case.rigidity = None),
        bulged("0/1 noise as rigidity", Certified, |case| {
            let noise =
                |x: usize, y: usize| (x as u32 * 7919 + y as u32 * 104_729 + 1).wrapping_mul(2_654_435_761);
            case.rigidity = Some(Map::new([GRID; 2], |x, y| (noise(x, y) >> 30 & 1) as f32));
        }),
        // Sixteen folds over 64 cells, of which each side is two cells wide: 60 degrees up and down. Nothing is
        // stretched, so vrtm knows the pose as isometric.
        fine("accordion, isometric", 32, Near(0.0), |[x, y, _]| {
            let k = (x - MARGIN) / (1.0 - 2.0 * MARGIN) * 32.0;
            let side = (1.0 - 2.0 * MARGIN) / 32.0;
            [MARGIN + 0.5 * k * side, y, (1.0 - (k.rem_euclid(2.0) - 1.0).abs()) * side * 0.75f64.sqrt()]
        }),
        // The sheet is also stretched by a thousandth, so that it is solved. A coarse level that took the folds for
        // compression would show. A chord over a fold of one cell's width is shorter than at rest, so that the finest
        // level does see some compression.
        fine("accordion, all but isometric", 32, Near(2.0), |[x, y, _]| {
            let k = (x - MARGIN) / (1.0 - 2.0 * MARGIN) * 32.0;
            let side = (1.0 - 2.0 * MARGIN) / 32.0;
            [
                MARGIN + 0.5 * k * side,
                1.001 * y,
                (1.0 - (k.rem_euclid(2.0) - 1.0).abs()) * side * 0.75f64.sqrt(),
            ]
        }),
        sheet("twisted by 180 degrees", Certified, |[x, y, _]| {
            let (sin, cos) = (std::f64::consts::PI * x).sin_cos();
            [x, 0.5 + (y - 0.5) * cos, (y - 0.5) * sin]
        }),
        sheet("sheared by 2", Certified, |[x, y, z]| [x + 2.0 * (y - 0.5), y, z]),
        sheet("turned inside out", Certified, |[x, y, z]| [1.0 - x * (1.0 + 0.3 * y), y, z]),
        sheet("stretched by 1000 in x", Certified, squash(1000.0)),
        sheet("scaled by 1e-20", Certified, |p| p.map(|x| x * 1e-20)),
        sheet("scaled by 1e30", Gain(0.99), |p| p.map(|x| x * 1e30)),
        sheet("scaled by 1e300", Certified, |p| p.map(|x| x * 1e300)),
        sheet(
            "one vertex at 1e30",
            Certified,
            |p| if p[0] == p[1] && p[0] == at(0.5) { [1e30; 3] } else { p },
        ),
        moved("rest and pose at 1e30", Gain(0.99), |p| p.map(|x| x * 1e30)),
        moved("rest and pose at 1e300", Gain(0.99), |p| p.map(|x| x * 1e300)),
        moved("rest and pose at 1e-300", Gain(0.99), |p| p.map(|x| x * 1e-300)),
        moved("rest and pose at the ends of f64", Gain(0.99), |[x, y, z]| {
            [10.0 * (x - 0.5) * 3.5e307, 10.0 * (y - 0.5) * 3.5e307, 3e307 * z]
        }),
        moved("rest and pose at 1e-320", Certified, |p| p.map(|x| x * 1e-320)),
        moved("rest at 1e-300, pose at 1e300", Certified, |[x, y, z]| {
            if z == 0.0 { [x, y, z].map(|x| x * 1e-300) } else { [x, y, z].map(|x| x * 1e300) }
        }),
        moved("rest is a line", Certified, |[x, _, z]| [x, 0.5, z]),
        moved("rest and pose are a point", Near(0.0), |_| [0.5; 3]),
        moved("1e6 units from the origin", Gain(0.99), |p| p.map(|x| x + 1e6)),
        moved("1:1000 in space", Certified, |[x, y, z]| [x, y * 1e-3, z]),
        bulged("1:1000 in UV", Certified, |case| {
            case.uvs.iter_mut().for_each(|uv| uv[1] = 0.5 + (uv[1] - 0.5) * 1e-3)
        }),
        bulged("1:1000 in UV, tall grid", Gain(0.99), |case| {
            case.uvs.iter_mut().for_each(|uv| uv[0] = 0.5 + (uv[0] - 0.5) * 1e-3);
            case.rigidity = Some(all(1.0));
            case.settings.grid = [Some(8192), Some(16)];
        }),
        bulged("rest is a point, pose is not", Certified, |case| case.rest.fill([0.5; 3])),
        // UVs.
        bulged("mirrored UVs", Gain(0.99), |case| case.uvs.iter_mut().for_each(|uv| uv[0] = 1.0 - uv[0])),
        bulged("UVs as slivers", Certified, |case| {
            case.uvs.iter_mut().for_each(|uv| uv[1] = 0.5 + (uv[1] - 0.5) * 1e-6)
        }),
        bulged("sliver triangles in the chart", Certified, |case| {
            // Every other column is moved almost onto its neighbour.
            for (k, uv) in case.uvs.iter_mut().enumerate() {
                if k % 17 % 2 == 1 {
                    uv[0] = (at((k % 17 - 1) as f64 / 16.0) + 1e-5) as f32;
                }
            }
        }),
        bulged("zero-area UVs here and there", Certified, |case| {
            for k in [40, 77, 120, 200] {
                case.uvs[k] = case.uvs[k + 1];
            }
        }),
        bulged("all UVs at one point", NoTile, |case| case.uvs.fill([0.5; 2])),
        bulged("single flipped triangles", Certified, |case| {
            case.triangles.chunks_exact_mut(3).step_by(37).for_each(|t| t.swap(0, 1));
        }),
        bulged("single vertices over their neighbours", Certified, |case| {
            for k in [40, 100, 150] {
                case.uvs[k][0] += 0.12;
            }
        }),
        bulged("triangles shrinking to 1e-30", Gain(0.99), |case| {
            // The first quad's corner, which lies on the tile's, is divided into a zigzag of triangles between the two
            // axes, each a hundred-thousandth of the previous one in UV, but half of it in space.
            case.uvs.iter_mut().for_each(|uv| *uv = uv.map(|x| x - MARGIN as f32));
            case.triangles.splice(0..6, [1, 18, 17]);
            let (mut x, mut y) = (1, 17);
            // Not by `powi`, whose last bit depends on how the compiler does it.
            let (mut size, mut length) = (0.05f32, 0.05f64);
            for _ in 1..7 {
                let n = case.rest.len() as u32;
                (size, length) = (1e-5 * size, 0.5 * length);
                case.triangles.extend([x, y, n, n, y, n + 1]);
                case.uvs.extend([[size, 0.0], [0.0, size]]);
                for points in [&mut case.rest, &mut case.poses[0]] {
                    points.extend([[MARGIN + length, MARGIN, 0.0], [MARGIN, MARGIN + length, 0.0]]);
                }
                (x, y) = (n, n + 1);
            }
        }),
        bulged("small triangles near 0 alone", Near(0.0), |case| {
            case.uvs.iter_mut().for_each(|uv| *uv = uv.map(|x| x * 1e-38));
        }),
        bulged("checkerboard of windings", Certified, |case| {
            case.triangles = quads([16, 16], |i, j| (i + j) % 2 == 0)
        }),
        fine("100k triangles on 64 cells", 224, Gain(0.99), bulge),
        bulged("one triangle", Certified, |case| {
            case.triangles = vec![0, 16, 16 * 17];
            case.poses[0][16] = [2.0, 0.0, 0.5];
        }),
        bulged("unused vertices", Gain(0.99), |case| {
            case.rest.extend([[1e300; 3], [-5.0; 3]]);
            case.poses[0].extend([[-1e300; 3], [7.0; 3]]);
            case.uvs.extend([[1e30; 2], [-3.0; 2]]);
        }),
        bulged("all faces outside every tile", NoTile, |case| {
            case.uvs.iter_mut().for_each(|uv| uv[0] -= 2.0)
        }),
        bulged("UVs at 1e30", NoTile, |case| case.uvs.iter_mut().for_each(|uv| *uv = uv.map(|x| x * 1e30))),
        bulged("one UV at 1e30", Certified, |case| case.uvs[150][0] = 1e30),
        bulged("UVs ten times the tile", Certified, |case| {
            case.uvs.iter_mut().for_each(|uv| *uv = uv.map(|x| 0.5 + 10.0 * (x - 0.5)));
        }),
        // Maps and grids.
        bulged("1x1 maps", Certified, |case| (case.rigidity, case.mask) = (Some(all(0.7)), Some(all(1.0)))),
        bulged("mask all fixed", Near(0.0), |case| case.mask = Some(all(0.0))),
        bulged("odd maps, grid of the features", Certified, |case| {
            case.rigidity = Some(Map::new([77, 33], |x, y| ((x / 9 + y / 5) % 2) as f32));
            case.mask = Some(Map::new([5, 201], |_, y| f32::from(y != 100)));
            case.settings.grid = [None; 2];
        }),
        bulged("grid 16x16", Certified, |case| case.settings.grid = [Some(16), Some(16)]),
        bulged("grid 1x1, rounded up", Certified, |case| case.settings.grid = [Some(1), Some(1)]),
        bulged("grid 16x4096", Certified, |case| case.settings.grid = [Some(16), Some(4096)]),
        bulged("grid 4096x16", Certified, |case| case.settings.grid = [Some(4096), Some(16)]),
        bulged("map 4096x1", Certified, |case| {
            case.rigidity = Some(Map::new([4096, 1], |x, _| (x / 300 % 2) as f32))
        }),
        bulged("mask with holes", Gain(0.99), |case| {
            case.mask = Some(Map::new([GRID; 2], |x, y| {
                f32::from((x % 16).abs_diff(8).pow(2) + (y % 16).abs_diff(8).pow(2) > 9)
            }));
        }),
        bulged("mask with a curve", Certified, |case| {
            case.mask = Some(Map::new([GRID; 2], |x, y| f32::from((x * x / 64).abs_diff(y) > 1)));
        }),
        bulged("mask as a checkerboard", Near(0.0), |case| {
            case.mask = Some(Map::new([GRID; 2], |x, y| f32::from((x + y) % 2 == 0)));
        }),
        bulged("mask as a checkerboard of 5 texels", Certified, |case| {
            case.mask = Some(Map::new([GRID; 2], |x, y| f32::from((x / 5 + y / 5) % 2 == 0)));
        }),
        charts("1000 tiny charts", 128, 3.0, 1000),
        bulged("settings at their ends", Certified, |case| {
            let room = TileSettings {
                smoothness: 1e6,
                smoothness_floor: 1e-6,
                orientation: 1e6,
                room: 1e6,
                room_threshold: 1.0,
                ..case.settings
            };
            case.settings = room;
        }),
        bulged("all weights at their least", Certified, |case| {
            case.settings = TileSettings {
                smoothness: 0.0,
                smoothness_floor: 1e-6,
                room: 0.0,
                room_threshold: 0.0,
                ..case.settings
            };
        }),
        // Options.
        bulged("draft", Gain(0.99), |case| case.options.quality = Quality::Draft),
        bulged("seven corrections", Gain(0.99), |case| case.options.max_corrections = Some(7)),
        bulged("budget of 0.01 ms", Truncated, |case| {
            case.options.time_budget = Some(std::time::Duration::from_micros(10));
        }),
        bulged("measured", Gain(0.99), |case| case.options.measure = true),
    ];
    // Strain is measured as well, with extreme numbers.
    for case in list.iter_mut().filter(|case| case.name.contains("e30") || case.name.contains("e-3")) {
        case.options.measure = true;
    }
    for texels in 1..=8 {
        list.push(charts(
            [
                "charts of 1 texel",
                "charts of 2 texels",
                "charts of 3 texels",
                "charts of 4 texels",
                "charts of 5 texels",
                "charts of 6 texels",
                "charts of 7 texels",
                "charts of 8 texels",
            ][texels - 1],
            64,
            texels as f64,
            16,
        ));
    }
    for (name, overlap) in [("overlap, fixed", Overlap::Fixed), ("overlap, first face", Overlap::FirstFace)] {
        // The right half of the UVs is the mirror image of the left half, at the same place.
        list.push(bulged(name, Certified, |case| {
            case.uvs.iter_mut().for_each(|uv| uv[0] = uv[0].min(1.0 - uv[0]));
            case.settings.overlap = overlap;
        }));
    }
    for (name, overlap) in
        [("two layers, fixed", Overlap::Fixed), ("two layers, first face", Overlap::FirstFace)]
    {
        list.push(bulged(name, Certified, |case| {
            let n = case.rest.len() as u32;
            case.triangles.extend(case.triangles.clone().iter().map(|v| v + n));
            case.uvs.extend(case.uvs.clone().iter().map(|uv| uv.map(|x| 0.9 * x + 0.08)));
            case.rest.extend(case.rest.clone().iter().map(|p| [p[0], p[1], 3.0]));
            case.poses[0].extend(case.rest[n as usize..].to_vec().iter().map(|&[x, y, z]| [x * 0.7, y, z]));
            case.settings.overlap = overlap;
        }));
    }
    for (name, warm) in [("20 frames", false), ("20 frames, warm", true)] {
        let mut case = sheet(name, Gain(0.99), |p| p);
        let pose = |frame: usize| {
            let fraction = frame as f64 / 20.0;
            case.rest
                .iter()
                .map(|&p| squash(1.0 - 0.5 * fraction)(bulge(p).map(|x| x * (1.0 + fraction))))
                .collect()
        };
        case.poses = (1..=20).map(pose).collect();
        case.options.warm = warm;
        list.push(case);
    }
    // A crushed frame, then rest, then a moderate pose.
    let mut case = sheet("warm through a collapse", Certified, |p| p);
    let points = |f: &dyn Fn([f64; 3]) -> [f64; 3]| case.rest.iter().map(|&p| f(p)).collect::<Points>();
    case.poses = vec![
        points(&bulge),
        points(&squash(0.01)),
        points(&|_| [0.5; 3]),
        case.rest.clone(),
        points(&squash(0.5)),
    ];
    case.options.warm = true;
    list.push(case);
    list
}

/// The bulge in units of 10^-6 to 10^6, the first one in units of 1; powers of two have to give the same bits.
pub fn units() -> Vec<Case> {
    [1.0, 1e-6, 1e-3, 1e3, 1e6, 2f64.powi(-20), 2f64.powi(20)]
        .into_iter()
        .map(|unit| moved("units", Expect::Gain(0.99), |p| p.map(|x| x * unit)))
        .collect()
}

/// A million triangles on a grid of 512 cells a side.
pub fn million() -> Case {
    let mut case = fine("a million triangles", 708, Expect::Gain(0.99), bulge);
    case.settings.grid = [Some(512); 2];
    case
}
