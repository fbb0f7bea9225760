//! A frame's result depends on its inputs alone: not on the number of threads, on earlier solves, or on other charts.

use vrtm::{Device, FetchKind, SolveOptions};

use vrtm_testkit::{self, Model, bits, fetch, long};

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

/// The creature, and which of its vertices belong to its first leg alone.
fn creature_and_leg() -> (Model, Vec<bool>) {
    let creature = Model::from(vrtm_testkit::scenes::creature());
    let leg = creature.vertices(|uv| uv[0] < 0.22 && uv[1] < 0.28);
    let others = creature.vertices(|uv| uv[0] >= 0.22 || uv[1] >= 0.28);
    let leg = leg.iter().zip(&others).map(|(leg, other)| *leg && !other).collect();
    (creature, leg)
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
        let report = asset.tile(0).report().unwrap();
        // In the second step the leg alone moves, back to rest; the six other charts that had moved stay.
        assert!(step != 1 || (report.charts_active, report.charts_reused) == (0, 6), "{report:?}");
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
