//! A frame's result depends on its inputs alone: not on the number of threads, on earlier solves, or on failed calls.

use vrtm::{Device, FetchKind, ImageView, Quality, SolveOptions, Strided};
use vrtm_testkit::Lab as _;

use vrtm_testkit::{self, Model, bits, fetch, long, options};

fn models() -> Vec<Model> {
    use vrtm_testkit::scenes::{arm, creature, mug_to_jug};
    let mut models: Vec<Model> = [mug_to_jug(), creature(), arm()].map(Model::from).into();
    models.push(vrtm_testkit::scenes::analytic::torus().into());
    models.extend(vrtm_testkit::assets());
    long::share(models, 4, "models")
}

#[test]
fn any_number_of_threads() {
    for model in models() {
        let solve = |threads: u32| {
            let mut asset = model.solved(&vrtm_testkit::cpu(threads), 256, 1, &SolveOptions::default());
            let redirection = fetch(&mut asset, 0, FetchKind::Redirection, [200, 200]);
            let report = asset.tile(0).report().unwrap();
            let redirection: Vec<_> = redirection.iter().map(|uv| uv.map(f32::to_bits)).collect();
            (bits(&asset), redirection, report.energy.to_bits(), report.min_jacobian.to_bits())
        };
        let one = solve(1);
        for threads in [2, 3, 7] {
            assert!(one == solve(threads), "{}: {threads} threads", model.name);
        }
    }
}

vrtm_testkit::on_both! {
    any_order_of_frames(&models(), 256),
    any_order_of_frames_on_a_gpu(&models()[..1], 64): frames_in_any_order
}

fn frames_in_any_order(device: &Device, models: &[Model], grid: u32) {
    for model in models.iter().filter(|model| model.frames.len() > 1) {
        // Three frames suffice.
        let count = model.frames.len().min(3);
        let alone: Vec<_> = (1..=count)
            .map(|frame| bits(&model.solved(device, grid, frame, &SolveOptions::default())))
            .collect();
        let mut asset = model.asset_on(device, grid);
        // All frames backwards, then the first one again, then the same frame twice.
        for frame in (1..=count).rev().chain([1, 1]) {
            asset.solve(model.frame(frame), &SolveOptions::default()).unwrap();
            assert!(bits(&asset) == alone[frame - 1], "{} frame {frame}", model.name);
        }
        // A solve at another quality, or a warm start, in between does not change later results.
        asset.solve(model.frame(count), &options(Quality::Draft)).unwrap();
        asset.solve(model.frame(2), &SolveOptions { warm: true, ..SolveOptions::default() }).unwrap();
        asset.solve(model.frame(2), &SolveOptions::default()).unwrap();
        assert!(bits(&asset) == alone[1], "{}", model.name);
    }
}

vrtm_testkit::on_both! {
    unchanged_charts_are_reused_and_what_a_fresh_solve_gives(256),
    unchanged_charts_are_reused_and_what_a_fresh_solve_gives_on_a_gpu(96): unchanged_charts_are_reused
}

/// The creature, and which of its vertices belong to its first leg alone.
fn creature_and_leg() -> (Model, Vec<bool>) {
    let creature = Model::from(vrtm_testkit::scenes::creature());
    let leg = creature.vertices(|uv| uv[0] < 0.22 && uv[1] < 0.28);
    let others = creature.vertices(|uv| uv[0] >= 0.22 || uv[1] >= 0.28);
    let leg = leg.iter().zip(&others).map(|(leg, other)| *leg && !other).collect();
    (creature, leg)
}

fn unchanged_charts_are_reused(device: &Device, grid: u32) {
    // After frame 1 the creature's first leg alone moves; its other charts keep their results.
    let (mut creature, leg) = creature_and_leg();
    let mut next = creature.frames[0].clone();
    for (v, p) in next.iter_mut().enumerate().filter(|(v, _)| leg[*v]) {
        p[1] = p[1] * 1.2 + 0.01 * (v % 2) as f32;
    }
    creature.frames.push(next);
    // The arm's forearm and upper arm are on different tiles.
    let mut arm = Model::from(vrtm_testkit::scenes::arm());
    let upper = arm.vertices(|uv| uv[0] < 1.0);
    let mut next = arm.frames[0].clone();
    next.iter_mut().zip(&upper).filter(|(_, upper)| !*upper).for_each(|(p, _)| p[2] *= 1.3);
    arm.frames.push(next);
    for model in [creature, arm] {
        let mut asset = model.solved(device, grid, 1, &SolveOptions::default());
        let before = asset.report().unwrap();
        let first = bits(&asset);
        asset.solve(model.frame(model.frames.len()), &SolveOptions::default()).unwrap();
        let report = asset.report().unwrap();
        println!("{}: {} charts solved, {} reused", model.name, report.charts_active, report.charts_reused);
        assert_eq!(report.charts_active, 1, "{}", model.name);
        assert_eq!(report.charts_reused, before.charts_active - 1, "{}", model.name);
        assert!(bits(&asset) != first, "{}", model.name);
        let mut fresh = model.solved(device, grid, model.frames.len(), &SolveOptions::default());
        assert!(bits(&asset) == bits(&fresh), "{}", model.name);
        // The report contains the energies of reused charts, too.
        for tile in 0..asset.tile_count() {
            let [a, b] = [&asset, &fresh].map(|asset| asset.tile(tile).report().unwrap());
            assert_eq!((a.energy_before, a.energy), (b.energy_before, b.energy), "{}", model.name);
            assert_eq!((a.min_jacobian, a.folds), (b.min_jacobian, b.folds), "{}", model.name);
        }
        // A changed setting is a changed input: nothing is reused.
        let settings = vrtm::TileSettings { smoothness: 0.1, ..asset.tile_mut(0).settings().unwrap() };
        asset.tile_mut(0).set_settings(&settings).unwrap();
        asset.solve(model.frame(model.frames.len()), &SolveOptions::default()).unwrap();
        fresh.tile_mut(0).set_settings(&settings).unwrap();
        fresh.solve(model.frame(model.frames.len()), &options(Quality::Draft)).unwrap();
        fresh.solve(model.frame(model.frames.len()), &SolveOptions::default()).unwrap();
        assert!(bits(&asset) == bits(&fresh), "{}", model.name);
        assert!(asset.tile(0).report().unwrap().charts_reused == 0, "{}", model.name);
    }
}

vrtm_testkit::on_both! {
    memory_of_older_results_leaves_no_trace(256),
    memory_of_older_results_leaves_no_trace_on_a_gpu(96): older_results_leave_no_trace
}

/// Results that were made in memory of results before: after each of them, charts that are not solved are the identity
/// or what they were, and a solve without time is the identity.
fn older_results_leave_no_trace(device: &Device, grid: u32) {
    let (mut creature, leg) = creature_and_leg();
    // All but the first leg are at rest; then the leg alone is.
    let part = |of_leg: bool| {
        let ends = creature.rest.iter().zip(&creature.frames[0]).enumerate();
        ends.map(|(v, (r, p))| if leg[v] == of_leg { *p } else { *r }).collect::<Vec<_>>()
    };
    let parts = [part(true), part(false)];
    creature.frames.truncate(1);
    creature.frames.extend(parts);
    let alone = [1, 2, 3].map(|frame| bits(&creature.solved(device, grid, frame, &SolveOptions::default())));
    let moved = |bits: &[[u32; 2]]| bits.iter().filter(|u| **u != [0, 0]).count();
    assert!(moved(&alone[1]) > 0 && moved(&alone[1]) < moved(&alone[0]));
    let no_time =
        SolveOptions { time_budget: Some(std::time::Duration::from_nanos(1)), ..SolveOptions::default() };
    let mut asset = creature.asset_on(device, grid);
    for (step, frame) in [1, 3, 2, 3, 1, 1, 2, 1, 3].into_iter().enumerate() {
        asset.solve(creature.frame(frame), &SolveOptions::default()).unwrap();
        assert!(bits(&asset) == alone[frame - 1], "step {step}");
        if step % 3 == 1 {
            // A setting that changed leaves no chart to keep.
            let settings = asset.tile_mut(0).settings().unwrap();
            asset.tile_mut(0).set_settings(&vrtm::TileSettings { smoothness: 0.1, ..settings }).unwrap();
            asset.solve(creature.frame(frame), &no_time).unwrap();
            assert!(bits(&asset) != alone[frame - 1], "step {step}");
            asset.tile_mut(0).set_settings(&settings).unwrap();
        }
    }
}

vrtm_testkit::on_both! {
    a_failed_call_leaves_the_last_result(256),
    a_failed_call_leaves_the_last_result_on_a_gpu(64): failed_calls_leave_the_result
}

fn failed_calls_leave_the_result(device: &Device, grid: u32) {
    let model = Model::from(vrtm_testkit::scenes::mug_to_jug());
    let mut asset = model.asset_on(device, grid);
    let nothing = asset.displacements(0);
    assert!(nothing.is_err(), "there is no result before the first solve");
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    let (result, report) = (bits(&asset), asset.tile(0).report().unwrap());
    let redirection = fetch(&mut asset, 0, FetchKind::Redirection, [128, 128]);
    let corners = vrtm_testkit::corner_uvs(&asset);

    for bad in [f32::NAN, f32::INFINITY] {
        let mut pose = model.rest.clone();
        pose[7][1] = bad;
        let error = asset.solve(Strided::from_slice(&pose), &SolveOptions::default()).unwrap_err();
        assert!(error.message.contains("positions[7]"), "{}", error.message);
    }
    let short = Strided::from_slice(&model.rest[1..]);
    assert!(asset.solve(short, &SolveOptions::default()).is_err());
    let bad = SolveOptions { tolerance: Some(f32::NAN), ..SolveOptions::default() };
    assert!(asset.solve(model.frame(1), &bad).is_err());
    let image = Some(ImageView::from_texels("map", &[0.5, f32::NAN], [2, 1]).unwrap());
    assert!(asset.tile_mut(0).set_rigidity(image).is_err());
    assert!(asset.tile_mut(0).set_mask(image).is_err());
    assert!(asset.set_vertex_rigidity(Some(Strided::from_slice(&[f32::NAN]))).is_err());
    assert!(asset.corner_uvs(0, &mut [[0.0; 2]]).is_err());

    assert!(bits(&asset) == result);
    let after = asset.tile(0).report().unwrap();
    assert_eq!((after.energy, after.nodes_active), (report.energy, report.nodes_active));
    assert_eq!(fetch(&mut asset, 0, FetchKind::Redirection, [128, 128]), redirection);
    let again = vrtm_testkit::corner_uvs(&asset);
    assert_eq!(corners, again);
    // The next solve still reuses the result.
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    assert_eq!(asset.tile(0).report().unwrap().charts_active, 0);
    assert!(bits(&asset) == result);
}

/// Two crowded sheets side by side in one tile; the right one has a pose of its own.
fn pair(right: f64) -> Model {
    let sheet = |fraction| Model::from(vrtm_testkit::scenes::analytic::squash(fraction));
    let (mut pair, right) = (sheet(0.4), sheet(right));
    let (vertices, uvs) = (pair.rest.len() as u32, pair.uvs.len() as u32);
    for uv in &mut pair.uvs {
        uv[0] *= 0.5;
    }
    pair.uvs.extend(right.uvs.iter().map(|uv| [0.5 + 0.5 * uv[0], uv[1]]));
    // The sheets are apart in space: their charts are not neighbours.
    let shifted = |p: &[f32; 3]| [p[0] + 2.0, p[1], p[2]];
    pair.rest.extend(right.rest.iter().map(shifted));
    pair.frames[0].extend(right.frames[0].iter().map(shifted));
    pair.face_counts.extend(&right.face_counts);
    pair.indices.extend(right.indices.iter().map(|v| v + vertices));
    pair.uv_indices.extend(right.uv_indices.iter().map(|uv| uv + uvs));
    let maps = &mut pair.maps[0];
    let rows = maps.rigidity.chunks(maps.width as usize);
    maps.rigidity = rows.flat_map(|row| [row, row].concat()).collect();
    maps.width *= 2;
    pair
}

vrtm_testkit::on_both! {
    a_crowded_chart_does_not_see_its_neighbour(256, Some(7)),
    a_crowded_chart_does_not_see_its_neighbour_on_a_gpu(128, None): charts_are_alone
}

fn charts_are_alone(device: &Device, grid: u32, max_corrections: Option<u32>) {
    let options = SolveOptions { max_corrections, ..SolveOptions::default() };
    let left = |right: f64| {
        let model = pair(right);
        let asset = model.solved(device, grid, 1, &options);
        let report = asset.tile(0).report().unwrap();
        println!(
            "right at {right}: {} charts solved, least J {:.4}",
            report.charts_active, report.min_jacobian
        );
        let width = grid as usize + 1;
        let row = |row: &[[u32; 2]]| row[..width / 2].to_vec();
        bits(&asset).chunks(width).flat_map(row).collect::<Vec<_>>()
    };
    let alone = left(1.0);
    assert!(alone.iter().any(|u| *u != [0; 2]));
    for right in [0.7, 0.1, 0.02] {
        assert!(left(right) == alone, "the right sheet at {right} changed the left one");
    }
}
