//! Noise in UVs and positions, meshes finer than the tolerances, and meshes as games have them.

use vrtm::{Quality, Weld, WeldBy};

use super::{GRID, QUADS, assert_near, by, energy, sheet, solved, unwelded, with_uvs};
use vrtm_testkit::processor::seconds;
use vrtm_testkit::{Model, assets, bits, cpu, options};

/// One step of f32 up, down or none, by a hash of the corner.
fn ulp(c: usize, x: f32) -> f32 {
    match c * 7919 % 3 {
        0 => x,
        1 => x.next_up(),
        _ => x.next_down(),
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
        assert_eq!(asset.tile(0).report().unwrap().welds_torn, 0);
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
    // Noise beyond the tolerance is told, and the noise of one that a host chose, too.
    let mut draw = vrtm_testkit::random::Random(3);
    let noise: Vec<f32> = (0..4 * 32 * 32).map(|_| draw.between(-1.0, 1.0) as f32).collect();
    for (noise_of, weld) in
        [(1e-3, Weld::default()), (3e-3, Weld { uv_tolerance: Some(2e-3), ..Weld::default() })]
    {
        let noisy = with_uvs(&sheet(32), |c, x| x * 0.9 + 0.05 + noise_of * noise[c % noise.len()]);
        let info = Model { weld, ..noisy }.asset_on(&device, 64).info();
        assert!(info.charts > 100 && info.edges_apart > 500, "{info:?}");
    }
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
    // Vertices nearer than the tolerance in space, with a far one that makes the mesh large: equal ones are welded,
    // near ones are not.
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
    // Triangles around one vertex that every one has for itself, an ulp from the others', or elsewhere: a square of
    // their number would take a hundred times as long.
    let n = 300_000u32;
    let seconds = [0.0, 0.2].map(|apart: f32| {
        let mut model = Model { weld: by(WeldBy::Position), ..Model::default() };
        for k in 0..n {
            let [angle, next] = [k, k + 1].map(|k| f64::from(k) / f64::from(n) * std::f64::consts::TAU);
            let rim = |a: f64| [a.cos() as f32, a.sin() as f32];
            let noise = f32::EPSILON * (k % 1009) as f32 * 1e-3;
            let [x, y] = rim(angle).map(|x| apart * x + noise);
            let corners = [[x, y - noise * 0.7], rim(angle), rim(next)];
            model.rest.extend(corners.map(|p| [p[0], p[1], 0.0]));
            model.uvs.extend(corners.map(|p| p.map(|x| 0.5 + 0.4 * x)));
            model.face_counts.push(3);
        }
        model.indices = (0..3 * n).collect();
        model.uv_indices = model.indices.clone();
        seconds(|| model.asset_on(&cpu(1), 64)).0
    });
    assert!(seconds[0] < 10.0 * seconds[1], "{seconds:?}");
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
        let solved = |model: &Model| model.solved(&device, 128, 1, &options(Quality::Draft));
        let (whole, game) = (solved(&model), solved(&game));
        let (info, of_game) = (whole.info(), game.info());
        println!("{}: {} charts, {} edges apart", model.name, info.charts, info.edges_apart);
        assert_eq!((info.charts, info.border_edges), (of_game.charts, of_game.border_edges));
        assert_eq!(game.tile(0).report().unwrap().welds_torn, 0);
        assert!(bits(&whole) == bits(&game), "{}", model.name);
    }
}
