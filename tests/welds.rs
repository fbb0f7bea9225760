//! Which corners of faces are one: by the host's vertices, by position with a tolerance, or not at all; and what a pose
//! that tears welded vertices apart does.

mod common;

use common::{Maps, Model, assets, bits, cpu, gpu, options};
use vrtm::{Asset, Device, DeviceSettings, Quality, Strided, Weld, WeldBy};

/// Quads on a side of the unit sheet.
const QUADS: usize = 32;
/// Cells on a side of the grid: eight per quad.
const GRID: usize = 256;

fn by(by: WeldBy) -> Weld {
    Weld { by, ..Weld::default() }
}

/// A unit sheet of quads with UVs equal to its positions, one `vt` per vertex, stretched along u by the pose, with discs of
/// rigidity.
fn sheet(quads: usize) -> Model {
    let count = (quads + 1) * (quads + 1);
    let place = |v: usize| [v % (quads + 1), v / (quads + 1)].map(|x| x as f32 / quads as f32);
    let rest: Vec<[f32; 3]> = (0..count).map(|v| [place(v)[0], place(v)[1], 0.0]).collect();
    let quad = |f: usize| {
        let a = (f / quads * (quads + 1) + f % quads) as u32;
        let n = quads as u32 + 1;
        [a, a + 1, a + n + 1, a + n]
    };
    let indices = (0..quads * quads).flat_map(quad).collect::<Vec<u32>>();
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

/// The same with a slit along v = 0.5 from u = 0.25 to u = 0.75: its vertices are doubled, at equal positions with equal
/// UVs, and the pose opens it. `two_vt`: the UVs are doubled, too. Returns the doubled vertices, as (below, above).
fn slit(two_vt: bool) -> (Model, Vec<[u32; 2]>) {
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
    let mut asset = model.asset_on(device, GRID as u32);
    asset.solve(model.frame(1), &options(Quality::Normal)).unwrap();
    asset
}

fn energy(asset: &Asset) -> [f64; 2] {
    let report = asset.tile_report(0).unwrap();
    [report.energy_before, report.energy]
}

/// A few nodes at the rim of a noisy edge may change sides; the energies of the whole are the same.
fn assert_near(a: [f64; 2], b: [f64; 2], tolerance: f64, what: &str) {
    for (a, b) in a.into_iter().zip(b) {
        assert!((a / b - 1.0).abs() < tolerance, "{what}: {a} {b}");
    }
}

fn devices() -> impl Iterator<Item = Device> {
    std::iter::once(cpu(0)).chain(gpu(&DeviceSettings::default()))
}

/// The number of nodes that move; panics if one lies on the slit and moves, or crosses it.
fn moving_beside_the_slit(asset: &Asset) -> usize {
    let (middle, ends) = (GRID as f64 / 2.0, [GRID as f64 / 4.0, 3.0 * GRID as f64 / 4.0]);
    let mut moved = 0;
    for (n, u) in asset.displacements(0).unwrap().iter().enumerate().filter(|(_, u)| **u != [0.0; 2]) {
        let p = [n % (GRID + 1), n / (GRID + 1)].map(|x| x as f64);
        let q = [0, 1].map(|c| p[c] + f64::from(u[c]));
        let [below, above] = [p, q].map(|p| p[1] - middle);
        let on_it = below == 0.0 && (ends[0]..=ends[1]).contains(&p[0]);
        assert!(!on_it, "node {p:?} lies on the slit and moves to {q:?}");
        if below * above < 0.0 {
            let meeting = p[0] + (q[0] - p[0]) * below / (below - above);
            assert!(!(ends[0]..=ends[1]).contains(&meeting), "node {p:?} crosses the slit to {q:?}");
        }
        moved += 1;
    }
    moved
}

#[test]
fn no_node_crosses_a_slit_that_is_closed_at_rest_and_opened_by_the_pose() {
    for device in devices() {
        for two_vt in [false, true] {
            for weld in [WeldBy::Index, WeldBy::Position, WeldBy::Off] {
                let model = Model { weld: by(weld), ..slit(two_vt).0 };
                let asset = solved(&model, &device);
                let (info, report) = (asset.info(), asset.tile_report(0).unwrap());
                assert_eq!(info.charts, 1);
                let torn = if weld == WeldBy::Position { QUADS as u32 / 2 } else { 0 };
                assert_eq!((info.welded_edges, report.welds_torn), (torn.into(), torn), "{weld:?}");
                assert_eq!(info.edges_apart, if torn > 0 { 0 } else { QUADS as u64 / 2 }, "{weld:?}");
                let moved = moving_beside_the_slit(&asset);
                println!("{weld:?}, two vt {two_vt}: {moved} nodes move");
                assert!(moved > 20_000, "{moved}");
            }
        }
    }
}

#[test]
fn a_torn_weld_is_the_cut_mesh_in_that_pose_alone() {
    for device in devices() {
        let (model, doubled) = slit(false);
        let welded = Model { weld: by(WeldBy::Position), ..model.clone() };
        let by_index = solved(&model, &device);
        let mut torn = solved(&welded, &device);
        assert!(bits(&by_index) == bits(&torn), "all torn is not what the vertices say");
        let corners = |asset: &Asset| {
            let mut uvs = vec![[f32::NAN; 2]; asset.info().corners as usize];
            asset.corner_uvs(&mut uvs).unwrap();
            uvs
        };
        assert!(corners(&by_index) == corners(&torn));
        // Closed again: as if nothing had been doubled.
        let mut closed = model.frames[0].clone();
        for [old, new] in &doubled {
            closed[*old as usize] = closed[*new as usize];
        }
        torn.solve(Strided::from_f32x3(&closed), &options(Quality::Normal)).unwrap();
        assert_eq!(torn.tile_report(0).unwrap().welds_torn, 0);
        let seamless = sheet(QUADS);
        let count = seamless.rest.len();
        let mut whole = seamless.asset_on(&device, GRID as u32);
        whole.solve(Strided::from_f32x3(&closed[..count]), &options(Quality::Normal)).unwrap();
        assert!(bits(&whole) == bits(&torn), "what is not torn is not the whole mesh");
        // Half of it: as a mesh with seams at the torn edges.
        let half: Vec<[u32; 2]> = doubled[..doubled.len() / 2].to_vec();
        let mut pose = closed.clone();
        for [old, new] in &half {
            pose[*old as usize] = model.frames[0][*old as usize];
            pose[*new as usize] = model.frames[0][*new as usize];
        }
        torn.solve(Strided::from_f32x3(&pose), &options(Quality::Normal)).unwrap();
        let first = half[0][0] - 1;
        let seams: Vec<[u32; 2]> = (0..=half.len() as u32).map(|k| [first + k, first + k + 1]).collect();
        assert_eq!(torn.tile_report(0).unwrap().welds_torn as usize, seams.len());
        let cut = Model { seams, ..welded.clone() };
        let mut cut = cut.asset_on(&device, GRID as u32);
        cut.solve(Strided::from_f32x3(&pose), &options(Quality::Normal)).unwrap();
        assert_eq!(cut.tile_report(0).unwrap().welds_torn, 0);
        assert!(bits(&cut) == bits(&torn), "a torn weld is not a seam");
        assert!(corners(&cut) == corners(&torn));
        // Poses that tear nothing build nothing anew, whatever was torn before.
        torn.solve(Strided::from_f32x3(&closed), &options(Quality::Normal)).unwrap();
        assert_eq!(torn.tile_report(0).unwrap().times.maps, 0.0);
        assert!(bits(&whole) == bits(&torn));
        // And the first pose again, after the others: the result is the pose's alone.
        torn.solve(model.frame(1), &options(Quality::Normal)).unwrap();
        assert!(bits(&by_index) == bits(&torn), "the result depends on earlier frames");
    }
}

/// One step of f32 up, down or none, by a hash of the corner.
fn ulp(c: usize, x: f32) -> f32 {
    match c * 7919 % 3 {
        0 => x,
        1 => x.next_up(),
        _ => x.next_down(),
    }
}

/// Applies `f` inside of the sheet. Its rim lies on lines of the grid: moved by a step, it would cover other nodes.
fn inside(f: impl Fn(usize, f32) -> f32) -> impl Fn(usize, f32) -> f32 {
    move |c, x| if x > 0.0 && x < 1.0 { f(c, x) } else { x }
}

#[test]
fn uvs_of_a_vertex_that_differ_by_rounding_are_one() {
    let device = cpu(0);
    let model = sheet(QUADS);
    let exact = energy(&solved(&model, &device));
    let scaled = |c: usize, x: f32| ulp(c, x * 0.93 + 0.011);
    let half = |c: usize, x: f32| half::f16::from_f32(scaled(c, x) + (c % 2) as f32 * 1e-5).to_f32();
    let text = |c: usize, x: f32| format!("{:.6}", scaled(c, x)).parse().unwrap();
    // The UVs of half of the corners went through another transform: a shift there and back.
    let moved = |c: usize, x: f32| if c.is_multiple_of(2) { (x + 3.7) * 0.1 * 10.0 - 3.7 } else { x };
    // Scaled UVs have other discs in other places of the surface: those are compared with the same ones, unrounded.
    let exact_scaled = energy(&solved(&with_uvs(&model, |_, x| x * 0.93 + 0.011), &device));
    let noisy = [
        ("one ulp", with_uvs(&model, inside(ulp)), exact, 1e-4),
        ("a transform", with_uvs(&model, inside(moved)), exact, 1e-4),
        // A step of half floats is an eighth of a cell here, and moves the chart's rim over nodes.
        ("half floats", with_uvs(&model, half), exact_scaled, 0.05),
        ("six digits", with_uvs(&model, text), exact_scaled, 1e-3),
    ];
    for (name, noisy, exact, tolerance) in noisy {
        let off = Model { weld: by(WeldBy::Off), ..noisy.clone() }.asset_on(&device, GRID as u32).info();
        let asset = solved(&noisy, &device);
        println!("{name}: {} charts, {} if welded exactly", asset.info().charts, off.charts);
        assert_eq!(asset.info().charts, 1, "{name}");
        assert!(off.charts > 1 && off.edges_apart > 0, "{name} tests nothing");
        println!("    E {:?}, of exact UVs {exact:?}", energy(&asset));
        assert_near(energy(&asset), exact, tolerance, name);
    }
}

#[test]
fn vertices_an_ulp_apart_are_one_by_position() {
    let device = cpu(0);
    for away in [0.0f32, 1000.0] {
        let model = sheet(QUADS);
        let exact = energy(&solved(&model, &device));
        let mut noisy = unwelded(&model);
        for points in noisy.frames.iter_mut().chain([&mut noisy.rest]) {
            for (k, p) in points.iter_mut().enumerate() {
                *p = [0, 1, 2].map(|c| ulp(3 * k + c, p[c] + away));
            }
        }
        let apart = noisy.asset_on(&device, GRID as u32).info();
        assert_eq!(apart.charts as usize, QUADS * QUADS);
        assert_eq!(apart.edges_apart as usize, 2 * QUADS * (QUADS - 1));
        noisy.weld = by(WeldBy::Position);
        let asset = solved(&noisy, &device);
        assert_eq!((asset.info().charts, asset.info().edges_apart), (1, 0));
        assert_eq!(asset.tile_report(0).unwrap().welds_torn, 0);
        // 1000 away, coordinates themselves are rounded to 6e-5, 2e-3 of a quad.
        assert_near(energy(&asset), exact, if away > 0.0 { 0.3 } else { 1e-3 }, "positions");
    }
}

#[test]
fn half_floats_of_one_uv_are_one_up_to_a_step() {
    // 1/2048 is the step of half floats from 0.5 to 1: a UV in the middle of two becomes either.
    let device = cpu(0);
    let model = sheet(8);
    let rounded = |c: usize, x: f32| if c.is_multiple_of(3) && x >= 0.5 { x + 1.0 / 2048.0 } else { x };
    assert_eq!(with_uvs(&model, rounded).asset_on(&device, 64).info().charts, 1);
    let more = |c: usize, x: f32| if c.is_multiple_of(3) { x + 1.1 / 2048.0 } else { x };
    assert!(with_uvs(&model, more).asset_on(&device, 64).info().charts > 1);
    // What the host says goes.
    let weld = Weld { uv_tolerance: Some(1e-3), ..Weld::default() };
    assert_eq!(Model { weld, ..with_uvs(&model, more) }.asset_on(&device, 64).info().charts, 1);
    // Triangles of a step's size cannot be welded by a step without turning over; it does not go by without a word.
    let info = with_uvs(&sheet(700), rounded).asset_on(&device, 64).info();
    assert!(info.charts > 1 && info.edges_apart > 1000, "{info:?}");
}

/// A strip of n by 2 quads whose UV edges are much shorter than the tolerance of UVs.
fn fine(n: usize, unit: f32) -> Model {
    let mut model = sheet(n);
    // All of it in a thousandth of the tile: an edge has a tolerance's hundredth.
    model.uvs.iter_mut().flatten().for_each(|x| *x = 0.5 + *x * 5e-6 * n as f32);
    model.rest.iter_mut().chain(&mut model.frames[0]).flatten().for_each(|x| *x *= unit);
    model
}

#[test]
fn small_triangles_are_not_welded_away() {
    let device = cpu(0);
    for unit in [1.0, 1e6, 1e-6] {
        for weld in [WeldBy::Index, WeldBy::Position] {
            for quads in [16, 100] {
                let model = Model { weld: by(weld), ..fine(quads, unit) };
                let info = model.asset_on(&device, 64).info();
                assert_eq!((info.charts, info.degenerate_triangles), (1, 0), "{weld:?}");
                assert_eq!(info.triangles as usize, 2 * quads * quads);
                assert_eq!(info.border_edges as usize, 4 * quads);
            }
        }
    }
    // Vertices nearer than the tolerance in space, with a far one that makes the mesh large: equal ones are welded, near
    // ones are not.
    let mut model = unwelded(&sheet(16));
    let far = model.rest.len() as u32;
    for points in [&mut model.rest, &mut model.frames[0]] {
        points.extend([[1e6, 0.0, 0.0], [1e6, 1.0, 0.0], [1e6, 1.0, 1.0]]);
    }
    model.uvs.extend([[0.0, 0.0], [0.01, 0.0], [0.0, 0.01]]);
    model.indices.extend([far, far + 1, far + 2]);
    model.uv_indices.extend([far, far + 1, far + 2]);
    model.face_counts.push(3);
    model.weld = by(WeldBy::Position);
    let info = model.asset_on(&device, 64).info();
    assert_eq!((info.charts, info.border_edges), (2, 4 * 16 + 3));
}

#[test]
fn a_million_vertices_at_one_place_take_no_longer_than_elsewhere() {
    // Triangles around one vertex that every one has for itself, an ulp from the others': a square of their number would
    // take minutes.
    let n = 300_000u32;
    let mut model = Model { weld: by(WeldBy::Position), ..Model::default() };
    for k in 0..n {
        let angle = f64::from(k) / f64::from(n) * std::f64::consts::TAU;
        let next = f64::from(k + 1) / f64::from(n) * std::f64::consts::TAU;
        let rim = |a: f64| [a.cos() as f32, a.sin() as f32];
        let noise = f32::EPSILON * (k % 1009) as f32 * 1e-3;
        let corners = [[noise, noise * 0.3], rim(angle), rim(next)];
        model.rest.extend(corners.map(|p| [p[0], p[1], 0.0]));
        model.uvs.extend(corners.map(|p| p.map(|x| 0.5 + 0.4 * x)));
        model.face_counts.push(3);
    }
    model.indices = (0..3 * n).collect();
    model.uv_indices = model.indices.clone();
    let start = std::time::Instant::now();
    let asset = model.asset_on(&cpu(0), 64);
    println!("{:?}: {} charts", start.elapsed(), asset.info().charts);
    assert!(start.elapsed().as_secs() < 20);
}

#[test]
fn the_two_sides_of_a_sheet_are_two_charts() {
    let mut model = sheet(8);
    let n = model.rest.len() as u32;
    let corners = model.indices.len();
    for k in 0..corners {
        // The back's faces run the other way round.
        let v = model.indices[k / 4 * 4 + 3 - k % 4];
        model.indices.push(v + n);
        model.uv_indices.push(v);
    }
    model.rest.extend_from_within(..);
    model.frames[0].extend_from_within(..);
    model.face_counts.extend_from_within(..);
    for weld in [WeldBy::Index, WeldBy::Position] {
        let info = Model { weld: by(weld), ..model.clone() }.asset_on(&cpu(0), 64).info();
        // Position takes nothing away from what the vertices connect; the rims, of which there are two at each edge on
        // the same side of it, stay borders.
        assert_eq!((info.charts, info.border_edges, info.welded_edges), (2, 64, 0), "{weld:?}");
        assert_eq!(info.edges_apart, 0);
    }
}

#[test]
fn a_t_junction_is_a_border() {
    // Two quads below, one above them, whose lower edge has no vertex in the middle.
    let points =
        [[0.1f32, 0.1], [0.5, 0.1], [0.9, 0.1], [0.1, 0.5], [0.5, 0.5], [0.9, 0.5], [0.1, 0.9], [0.9, 0.9]];
    let indices = vec![0, 1, 4, 3, 1, 2, 5, 4, 3, 5, 7, 6];
    for weld in [WeldBy::Index, WeldBy::Position] {
        let model = Model {
            rest: points.map(|[x, y]| [x, y, 0.0]).to_vec(),
            uvs: points.to_vec(),
            face_counts: vec![4; 3],
            indices: indices.clone(),
            uv_indices: indices.clone(),
            weld: by(weld),
            ..Model::default()
        };
        let info = model.asset_on(&cpu(0), 64).info();
        assert_eq!((info.charts, info.border_edges, info.edges_apart), (2, 10, 0));
    }
}

/// Real meshes as a game would have them, with vertices of its own for every face.
#[test]
fn unwelded_assets_are_as_before_if_welded_by_position() {
    let device = cpu(0);
    for model in assets() {
        let game = Model { weld: by(WeldBy::Position), ..unwelded(&model) };
        let solved = |model: &Model| {
            let mut asset = model.asset_on(&device, 128);
            asset.solve(model.frame(1), &options(Quality::Draft)).unwrap();
            asset
        };
        let (whole, game) = (solved(&model), solved(&game));
        let (info, of_game) = (whole.info(), game.info());
        println!("{}: {} charts, {} edges apart", model.name, info.charts, info.edges_apart);
        assert_eq!((info.charts, info.border_edges), (of_game.charts, of_game.border_edges));
        assert_eq!(game.tile_report(0).unwrap().welds_torn, 0);
        assert!(bits(&whole) == bits(&game), "{}", model.name);
    }
}
