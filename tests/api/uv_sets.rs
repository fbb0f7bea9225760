//! Redirections as UVs of another UV set: solved in a set without overlaps, written for the one that textures use.

use vrtm::{
    Asset, ErrorKind, FetchKind, ImageLayout, ImageViewMut, MapDesc, MeshSource, PixelFormat, Seams,
    SolveOptions, Strided, TileSettings, UvSource,
};
use vrtm_testkit::{Model, cpu, fetch, quads, scenes, texels, view};

const SIDE: usize = 12;
const MAP: u32 = 64;

/// A sheet of squares, (SIDE + 1)^2 vertices over -1..1, whose set 0 is unique. Set 1 is `second` of the place on the
/// sheet.
struct Sheet {
    rest: Vec<[f32; 3]>,
    pose: Vec<[f32; 3]>,
    indices: Vec<u32>,
    first: [Vec<f32>; 2],
    second: [Vec<f32>; 2],
    /// The UV of each corner in both sets.
    first_corners: Vec<u32>,
    second_corners: Vec<u32>,
    rigidity: Vec<u8>,
}

/// The place on the sheet, -1..1, of a UV of set 0.
fn place(uv: [f64; 2]) -> [f64; 2] {
    [0, 1].map(|k| (uv[k] - 0.5) / 0.45)
}

impl Sheet {
    fn new(second: impl Fn([f64; 2]) -> [f64; 2]) -> Sheet {
        let mut sheet = Sheet {
            rest: Vec::new(),
            pose: Vec::new(),
            indices: Vec::new(),
            first: Default::default(),
            second: Default::default(),
            first_corners: Vec::new(),
            second_corners: Vec::new(),
            rigidity: vec![0; (MAP * MAP) as usize],
        };
        for j in 0..=SIDE {
            for i in 0..=SIDE {
                let at = [i, j].map(|n| 2.0 * n as f64 / SIDE as f64 - 1.0);
                let [x, y] = at;
                sheet.rest.push([x as f32, y as f32, 0.0]);
                let posed =
                    [x + 0.25 * (2.0 * y).sin() * (1.0 - x * x), y + 0.2 * (3.0 * x).cos() * (1.0 - y * y)];
                sheet.pose.push([posed[0] as f32, posed[1] as f32, (0.1 * x * y) as f32]);
                for k in 0..2 {
                    sheet.first[k].push((0.5 + 0.45 * at[k]) as f32);
                    sheet.second[k].push(second(at)[k] as f32);
                }
            }
        }
        sheet.indices = quads([SIDE; 2], 0);
        sheet.first_corners = sheet.indices.clone();
        sheet.second_corners = sheet.indices.clone();
        for (n, texel) in sheet.rigidity.iter_mut().enumerate() {
            let [x, y] =
                [n % MAP as usize, n / MAP as usize].map(|k| (k as f64 + 0.5) / f64::from(MAP) * 5.0);
            *texel = 255 * u8::from((x.fract() - 0.5).hypot(y.fract() - 0.5) < 0.25);
        }
        sheet
    }

    fn solved(&self, settings: &TileSettings) -> Asset {
        let counts = vec![4; SIDE * SIDE];
        let source = MeshSource {
            positions: Strided::from_slice(&self.rest),
            face_counts: Some(&counts),
            indices: &self.indices,
            uvs: uvs(&self.first, &self.first_corners),
            uv_sets: &[uvs(&self.second, &self.second_corners)],
            ..MeshSource::default()
        };
        let mut asset = Asset::new(&cpu(2), &source).unwrap();
        asset.tile_mut(0).set_rigidity(Some(view(&self.rigidity, MAP, MAP))).unwrap();
        asset.tile_mut(0).set_settings(&TileSettings { grid: [Some(64); 2], ..*settings }).unwrap();
        asset.solve(Strided::from_slice(&self.pose), &SolveOptions::default()).unwrap();
        asset
    }
}

fn uvs<'a>([u, v]: &'a [Vec<f32>; 2], indices: &'a [u32]) -> UvSource<'a> {
    UvSource { u: Strided::from_slice(u), v: Some(Strided::from_slice(v)), indices: Some(indices) }
}

const SIZE: [u32; 2] = [150, 130];

fn centre(n: usize) -> [f64; 2] {
    let [x, y] = [n % SIZE[0] as usize, n / SIZE[0] as usize];
    [(x as f64 + 0.5) / f64::from(SIZE[0]), (y as f64 + 0.5) / f64::from(SIZE[1])]
}

fn inside(uv: [f64; 2]) -> bool {
    place(uv).into_iter().all(|x| x.abs() < 1.0)
}

/// Compares both forms with a function of the UV of set 0 that is linear on each square.
fn check(asset: &mut Asset, second: impl Fn([f64; 2]) -> [f64; 2], skip: impl Fn([f64; 2]) -> bool) -> usize {
    let redirected = fetch(asset, 0, FetchKind::Redirection, SIZE);
    let values = fetch(asset, 0, FetchKind::UvSet(1), SIZE);
    let deltas = fetch(asset, 0, FetchKind::UvSetDelta(1), SIZE);
    let mut moved = 0;
    for n in (0..redirected.len()).filter(|&n| inside(centre(n))) {
        let to = redirected[n].map(f64::from);
        if skip(centre(n)) || skip(to) {
            continue;
        }
        let (here, there) = (second(place(centre(n))), second(place(to)));
        for c in 0..2 {
            let scale = 1.0 + there[c].abs();
            assert!(
                (f64::from(values[n][c]) - there[c]).abs() < 3e-6 * scale,
                "{n}: {values:?}",
                values = values[n]
            );
            assert!((f64::from(deltas[n][c]) - (there[c] - here[c])).abs() < 3e-6 * scale, "{n}");
        }
        moved += usize::from(deltas[n] != [0.0; 2]);
    }
    assert!(moved > 5000, "{moved}");
    moved
}

/// A texture that repeats: UVs far beyond 0..1, turned and scaled.
#[test]
fn a_set_of_repeating_texture() {
    let second = |[x, y]: [f64; 2]| [7.0 * x - 3.0 * y + 20.0, 4.0 * x + 5.0 * y - 11.5];
    let mut asset = Sheet::new(second).solved(&TileSettings::default());
    check(&mut asset, second, |_| false);
}

/// The two halves of the sheet lie on the same UVs of set 1.
#[test]
fn a_mirrored_set() {
    let second = |[x, y]: [f64; 2]| [x.abs() * 0.9, 0.5 + 0.4 * y];
    let mut asset = Sheet::new(second).solved(&TileSettings::default());
    check(&mut asset, second, |_| false);
    // In the mirrored set itself all is overlapped; its border lies beside a line of the grid, whose nodes count once.
    let overlap = asset.tile_mut(1).info().unwrap().overlap;
    assert!((0.98..=1.0).contains(&overlap), "{overlap}");
}

/// If the other set has a border in the middle of a chart, each texel has the UVs of one of its sides.
#[test]
fn a_border_of_the_other_set_inside_of_a_chart() {
    let second = |[x, y]: [f64; 2]| [0.3 * x + if x < 0.0 { 0.35 } else { 3.65 }, 0.5 + 0.4 * y];
    let mut sheet = Sheet::new(second);
    // Corners on the border of the left half get UVs of their own.
    let vertices = sheet.rest.len() as u32;
    for j in 0..=SIDE {
        sheet.second[0].push(0.35);
        sheet.second[1].push((0.5 + 0.4 * (2.0 * j as f64 / SIDE as f64 - 1.0)) as f32);
    }
    for corner in sheet.second_corners.chunks_exact_mut(4).enumerate().filter(|(f, _)| f % SIDE < SIDE / 2) {
        for v in corner.1 {
            if *v as usize % (SIDE + 1) == SIDE / 2 {
                *v = vertices + *v / (SIDE as u32 + 1);
            }
        }
    }
    let mut asset = sheet.solved(&TileSettings::default());
    // On the border itself either side will do.
    check(&mut asset, second, |uv| place(uv)[0].abs() < 1e-6);
}

/// Beside the chart, the margin goes on with the UVs of the chart's border; beyond it there is nothing.
#[test]
fn beside_charts_there_is_a_margin() {
    let second = |[x, y]: [f64; 2]| [2.0 * x + y, 3.0 * y - x];
    let asset = Sheet::new(second).solved(&TileSettings::default());
    let texels = texels(asset.results(), 0, FetchKind::UvSet(1), SIZE, [0.0f32; 4]);
    let (mut margin, mut nothing) = (0, 0);
    for (n, texel) in texels.iter().enumerate() {
        let at = place(centre(n));
        // Distance from the chart, in texels.
        let beside = [0, 1].map(|k| (at[k].abs() - 1.0).max(0.0) * 0.45 * f64::from(SIZE[k]));
        let far = beside[0].max(beside[1]);
        // On the border itself a centre may count as covered or not.
        if at.iter().all(|x| (x.abs() - 1.0).abs() > 1e-6) {
            assert_eq!(texel[3], f32::from(u8::from(far == 0.0)), "{n}");
        }
        if far > 0.0 && far < 1.9 {
            let expected = second(at);
            assert!(
                (0..2).all(|c| (f64::from(texel[c]) - expected[c]).abs() < 1e-4),
                "{n}: {texel:?} {expected:?}"
            );
            margin += 1;
        } else if far > 2.1 {
            assert_eq!(texel[..2], [0.0; 2]);
            nothing += 1;
        }
    }
    assert!(margin > 500 && nothing > 500, "{margin} {nothing}");
}

#[test]
fn the_tile_s_own_set_is_the_redirection_itself() {
    // Also of a mesh that has no other set, in both of its tiles.
    let model = Model::from(scenes::by_name("arm").unwrap());
    let mut arm = model.solved(&cpu(2), 64, 3, &SolveOptions::default());
    for tile in 0..2 {
        let values = fetch(&mut arm, tile, FetchKind::UvSet(0), SIZE);
        let redirected = fetch(&mut arm, tile, FetchKind::RedirectionUdim, SIZE);
        let deltas = fetch(&mut arm, tile, FetchKind::RedirectionDelta, SIZE);
        let moved = (0..values.len()).filter(|&n| deltas[n] != [0.0; 2]);
        let near = |n: usize| (0..2).all(|c| (values[n][c] - redirected[n][c]).abs() < 1e-6);
        assert!(moved.clone().count() > 1000 && moved.clone().all(near));
    }
    let second = |[x, y]: [f64; 2]| [x, y];
    let mut asset = Sheet::new(second).solved(&TileSettings::default());
    let values = fetch(&mut asset, 0, FetchKind::UvSet(0), SIZE);
    let redirected = fetch(&mut asset, 0, FetchKind::Redirection, SIZE);
    for n in (0..values.len()).filter(|&n| inside(centre(n))) {
        assert!((0..2).all(|c| (values[n][c] - redirected[n][c]).abs() < 5e-7), "{n}");
    }
}

/// If features continue over seams, the other set's UVs come from the continued surface.
#[test]
fn charts_that_go_on_beyond_seams() {
    // Set 0 has a seam at x = 0: its left half lies elsewhere in the tile.
    let second = |[x, y]: [f64; 2]| [3.0 * x + 2.0, 3.0 * y];
    let mut sheet = Sheet::new(second);
    let vertices = sheet.rest.len();
    for v in 0..vertices {
        // The right half, and again the left one.
        let [x, y] = [sheet.rest[v][0], sheet.rest[v][1]];
        sheet.first[0].push(0.46 + 0.4 * x);
        sheet.first[1].push(0.5 + 0.45 * y);
        sheet.first[0][v] = 0.54 + 0.4 * x;
    }
    for k in 0..2 {
        let again = sheet.second[k].clone();
        sheet.second[k].extend(again);
    }
    let left = sheet.first_corners.chunks_exact_mut(4).enumerate().filter(|(f, _)| f % SIDE < SIDE / 2);
    left.for_each(|(_, face)| face.iter_mut().for_each(|v| *v += vertices as u32));
    let mut asset = sheet.solved(&TileSettings { seams: Seams::Continue, ..TileSettings::default() });
    let redirected = fetch(&mut asset, 0, FetchKind::Redirection, SIZE);
    let values = fetch(&mut asset, 0, FetchKind::UvSet(1), SIZE);
    // The place on the sheet that a half shows at a UV, also beyond the seam.
    let shown = |right: bool, uv: [f64; 2]| {
        let first = if right { 0.54 } else { 0.46 };
        [(uv[0] - first) / 0.4, (uv[1] - 0.5) / 0.45]
    };
    let mut beyond = 0;
    for n in 0..values.len() {
        let uv = centre(n);
        let right = uv[0] > 0.54;
        let at = shown(right, uv);
        if at[1].abs() >= 1.0 || at[0].abs() >= 1.0 || (0.46..=0.54).contains(&uv[0]) {
            continue;
        }
        let to = shown(right, redirected[n].map(f64::from));
        let expected = second(to);
        assert!(
            (0..2).all(|c| (f64::from(values[n][c]) - expected[c]).abs() < 2e-4),
            "{uv:?}: {:?} {expected:?}",
            values[n]
        );
        beyond += usize::from((to[0] > 0.0) != right);
    }
    assert!(beyond > 20, "{beyond}");
}

#[test]
fn what_cannot_be_is_refused() {
    let asset = Sheet::new(|at| at).solved(&TileSettings::default());
    let mut bytes = vec![0; 8 * 16 * 16];
    let mut image =
        ImageViewMut::new("image", &mut bytes, ImageLayout::packed(16, 16, PixelFormat::F32)).unwrap();
    let error = asset.tile(0).fetch(FetchKind::UvSet(2), &mut image).unwrap_err();
    assert_eq!(error.message, "uv_set: 2 is out of range, there are 2");
    let mut image = image.part_of("image", [32, 32], [0, 0]).unwrap();
    let error = asset.tile(0).fetch(FetchKind::UvSet(1), &mut image).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Unsupported);
    let desc = MapDesc { kind: FetchKind::UvSet(1), format: PixelFormat::F32, size: [64; 2] };
    assert_eq!(asset.tile(0).inspect_map(&desc).unwrap_err().kind, ErrorKind::InvalidArgument);
}
