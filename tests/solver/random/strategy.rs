//! How recipes are drawn: mostly moderate values, sometimes the least or greatest that is allowed. Alternatives are
//! listed in the order in which a failure shrinks: the simplest one first.

use proptest::bool::weighted;
use proptest::collection::vec;
use proptest::option;
use proptest::prelude::*;
use proptest::sample::select;
use vrtm::{OpenBorders, Overlap, Quality, Seams, SolveOptions, TileSettings, WeldBy};

use super::recipe::{Joints, Layer, Move, Paint, Piece, Recipe, Refusal, Rigidity, Shape, Then};

pub fn recipe() -> impl Strategy<Value = Recipe> {
    let mesh = (vec(piece(), 1..4), joints(), any::<bool>(), weighted(0.3), any::<bool>(), unit(), away());
    let maps = (rigidity(), option::weighted(0.25, layer(mask_paint())), settings(), options());
    let frame = || prop_oneof![15 => vec(step(), 1..4), 1 => Just(Vec::new())];
    let frames = prop_oneof![5 => vec(frame(), 1), 1 => vec(frame(), 2..4)];
    let output = prop_oneof![Just([16, 16]), [1..40u32, 1..40u32]];
    let runs = (frames, output, prop_oneof![8 => Just(1), 1 => 2..4u32], then());
    (mesh, maps, runs).prop_map(|(mesh, maps, runs)| {
        let (pieces, joints, polygons, split_uvs, doubles, unit, away) = mesh;
        let (rigidity, mask, mut settings, options) = maps;
        let (frames, output, threads, then) = runs;
        if matches!(rigidity, Rigidity::Vertices(_)) {
            // Without a map the default grid would have 1024 cells a side.
            settings.grid = settings.grid.map(|n| Some(n.unwrap_or(0).max(16)));
        }
        Recipe {
            pieces,
            joints,
            polygons,
            split_uvs,
            doubles,
            unit,
            away,
            rigidity,
            mask,
            settings,
            options,
            frames,
            output,
            threads,
            then,
        }
    })
}

fn joints() -> impl Strategy<Value = Joints> {
    let cut = prop_oneof![2 => Just(0.0f32), 1 => 0.0..0.4f32];
    let noise = prop_oneof![3 => Just(0.0f32), 1 => magnitude(-8.0, -5.5)];
    let weld = prop_oneof![Just(WeldBy::Index), Just(WeldBy::Position), Just(WeldBy::Off)];
    let every = || prop_oneof![5 => Just(0u32), 1 => 1..30u32];
    (cut, noise, weld, every(), every(), any::<bool>(), 0..1000u32).prop_map(
        |(cut, noise, weld, seams, bare, offsets, seed)| Joints {
            cut,
            noise,
            weld,
            seams,
            bare,
            offsets,
            seed,
        },
    )
}

/// A log-uniform number between 10^low and 10^high.
fn magnitude(low: f32, high: f32) -> impl Strategy<Value = f32> + Clone {
    (low..=high).prop_map(|exponent| 10f32.powf(exponent))
}

fn signed(low: f32, high: f32) -> impl Strategy<Value = f64> + Clone {
    (magnitude(low, high), any::<bool>()).prop_map(|(x, minus)| f64::from(if minus { -x } else { x }))
}

fn unit() -> impl Strategy<Value = i32> {
    prop_oneof![6 => Just(0), 2 => -6..=6, 1 => select(vec![-30, -20, 20, 30])]
}

fn away() -> impl Strategy<Value = f64> {
    prop_oneof![6 => Just(0.0), 1 => signed(0.0, 6.0)]
}

fn piece() -> impl Strategy<Value = Piece> {
    let shape = prop_oneof![
        12 => (1..=8u32, 1..=8u32).prop_map(|(x, y)| Shape::Sheet(x, y)),
        2 => (1..=12u32).prop_map(Shape::Strip),
        2 => (3..=9u32).prop_map(Shape::Fan),
        1 => (3..=7u32).prop_map(Shape::Polygon),
    ];
    // Large ones, some of a few texels, slivers; sometimes across the tile's border, or outside of all tiles.
    let size = prop_oneof![
        12 => [0.3..0.95f32, 0.3..0.95f32],
        2 => [0.02..0.3f32, 0.02..0.3f32],
        1 => (0.3..0.95f32, magnitude(-7.0, -1.0)).prop_map(|(long, thin)| [long, thin]),
        1 => (0.3..0.95f32, magnitude(-7.0, -1.0)).prop_map(|(long, thin)| [thin, long]),
    ];
    let low = prop_oneof![12 => [0.0..0.3f32, 0.0..0.3f32], 2 => [0.0..1.5f32, 0.0..0.7f32], 1 => [-0.6..1.0f32, -0.6..1.5f32]];
    let turn = prop_oneof![4 => Just(0.0), 1 => 0.0..6.3f32];
    let jitter = prop_oneof![3 => Just(0.0), 3 => 0.0..0.6f32, 1 => 0.6..3.0f32];
    let every = || prop_oneof![12 => Just(0), 1 => 1..20u32];
    let stretch = prop_oneof![
        5 => Just([1.0; 2]),
        1 => [magnitude(-0.5, 0.5), magnitude(-0.5, 0.5)],
        1 => [magnitude(-3.0, 3.0), magnitude(-3.0, 3.0)],
    ];
    let bend = || prop_oneof![3 => Just(0.0), 1 => magnitude(-4.0, 0.5)];
    let outline = (shape, low, size, turn, any::<bool>(), jitter);
    (outline, every(), every(), stretch, bend(), bend(), 0..1000u32).prop_map(
        |((shape, low, size, turn, mirrored, jitter), flip, weld, stretch, bend, crumple, seed)| Piece {
            shape,
            low,
            size,
            turn,
            mirrored,
            jitter,
            flip,
            weld,
            stretch,
            bend,
            crumple,
            seed,
        },
    )
}

fn paint() -> impl Strategy<Value = Paint> {
    prop_oneof![
        2 => Just(Paint::Constant(1.0)),
        1 => (0.0..=1.0f32).prop_map(Paint::Constant),
        3 => (1..8u32).prop_map(Paint::Discs),
        2 => (0..1000u32).prop_map(Paint::Bits),
        2 => (0..1000u32).prop_map(Paint::Grey),
        1 => (1..9u32).prop_map(Paint::Checker),
        1 => Just(Paint::Curve),
        1 => Just(Paint::Constant(0.0)),
    ]
}

fn mask_paint() -> impl Strategy<Value = Paint> {
    prop_oneof![
        3 => (1..5u32).prop_map(Paint::Holes),
        2 => Just(Paint::Curve),
        2 => (1..12u32).prop_map(Paint::Checker),
        1 => (0..1000u32).prop_map(Paint::Bits),
        1 => prop_oneof![Just(0.0f32), Just(0.5), Just(1.0)].prop_map(Paint::Constant),
    ]
}

fn layer(paint: impl Strategy<Value = Paint>) -> impl Strategy<Value = Layer> {
    let size =
        prop_oneof![4 => Just([16, 16]), 2 => [1..=48u32, 1..=48u32], 1 => Just([1, 1]), 1 => Just([48, 48])];
    (size, paint).prop_map(|(size, paint)| Layer { size, paint })
}

fn rigidity() -> impl Strategy<Value = Rigidity> {
    prop_oneof![
        12 => layer(paint()).prop_map(Rigidity::Map),
        3 => paint().prop_map(Rigidity::Vertices),
        1 => Just(Rigidity::Nothing),
    ]
}

fn settings() -> impl Strategy<Value = TileSettings> {
    let cells = || prop_oneof![4 => Just(16u32), 4 => Just(32), 2 => Just(48), 1 => 1..48u32, 1 => Just(0)];
    let overlap = prop_oneof![Just(Overlap::Fixed), Just(Overlap::FirstFace)];
    // The whole range of a weight, 10^-6 to 10^6.
    let weight = || prop_oneof![1 => Just(0.0f32), 4 => magnitude(-6.0, 5.99)];
    let default = TileSettings::default();
    let weights = prop_oneof![
        5 => Just([default.smoothness, default.smoothness_floor, 0.0, default.room, default.room_threshold]),
        1 => (weight(), magnitude(-5.99, 5.99), weight(), weight(), 0.0..=1.0f32)
            .prop_map(|(a, b, c, d, e)| [a, b, c, d, e]),
        1 => (magnitude(-3.0, 0.0), magnitude(-4.0, -2.0), magnitude(-3.0, 0.0), magnitude(-2.0, 1.0), 0.0..=1.0f32)
            .prop_map(|(a, b, c, d, e)| [a, b, c, d, e]),
    ];
    let density = prop_oneof![6 => Just(0.0f32), 1 => magnitude(-3.0, 1.0)];
    let seams = prop_oneof![3 => Just(Seams::Shut), 2 => Just(Seams::Continue), 1 => Just(Seams::Keep)];
    let open_borders = prop_oneof![3 => Just(OpenBorders::Fixed), 2 => Just(OpenBorders::Slide)];
    let reach = prop_oneof![2 => Just(default.seam_reach), 2 => magnitude(-3.0, -0.31)];
    let harm = prop_oneof![4 => Just(default.harm), 1 => 0.0..=16.0f32];
    let all = ([cells(), cells()], weights, density, overlap, seams, open_borders, reach, harm);
    all.prop_map(|(grid, w, density, overlap, seams, open_borders, seam_reach, harm)| TileSettings {
        grid: grid.map(|n| (n > 0).then_some(n)),
        smoothness: w[0],
        smoothness_floor: w[1],
        orientation: w[2],
        orientation_density: density,
        room: w[3],
        room_threshold: w[4],
        overlap,
        // They do not go together.
        seams: if density > 0.0 { Seams::Shut } else { seams },
        open_borders: if density > 0.0 { OpenBorders::Fixed } else { open_borders },
        seam_reach,
        harm,
    })
}

fn options() -> impl Strategy<Value = SolveOptions> {
    let quality = prop_oneof![1 => Just(Quality::Draft), 3 => Just(Quality::Normal)];
    let tolerance = prop_oneof![6 => Just(0.0f32), 1 => magnitude(-6.0, -0.1)];
    let cap = prop_oneof![6 => Just(0u32), 1 => 1..8u32];
    let temporal = prop_oneof![2 => Just(0.0f32), 1 => magnitude(-4.0, 2.0), 1 => Just(1e6)];
    (quality, weighted(0.2), temporal, tolerance, cap, weighted(0.05)).prop_map(
        |(quality, warm, temporal_weight, tolerance, max_corrections, measure)| SolveOptions {
            quality,
            warm,
            temporal_weight,
            tolerance: (tolerance > 0.0).then_some(tolerance),
            max_corrections: (max_corrections > 0).then_some(max_corrections),
            measure,
            ..SolveOptions::default()
        },
    )
}

fn step() -> impl Strategy<Value = Move> {
    let factor = || prop_oneof![2 => Just(1.0), 3 => 0.3..1.7f64, 1 => signed(-4.0, 2.0), 1 => Just(0.0)];
    prop_oneof![
        3 => [factor(), factor(), factor()].prop_map(Move::Scale),
        1 => (-3.2..3.2f64).prop_map(Move::Turn),
        2 => signed(-2.0, 1.0).prop_map(Move::Shear),
        2 => signed(-2.0, 1.0).prop_map(Move::Twist),
        4 => signed(-2.0, 1.0).prop_map(Move::Bulge),
        2 => (magnitude(-2.5, 0.0), 0..1000u32).prop_map(|(size, seed)| Move::Noise(size.into(), seed)),
        2 => (magnitude(-7.0, 1.0), 0..1000u32).prop_map(|(size, seed)| Move::Noise(size.into(), seed)),
        1 => signed(-3.0, 6.0).prop_map(Move::Shift),
        1 => signed(-6.0, 6.0).prop_map(|s| Move::Scale([s; 3])),
        1 => (0..1000u32, signed(-3.0, 6.0)).prop_map(|(k, size)| Move::Spike(k, size)),
        1 => Just(Move::Line),
        1 => Just(Move::Point),
    ]
}

fn then() -> impl Strategy<Value = Then> {
    let refusal = prop_oneof![
        (0..1000u32).prop_map(Refusal::NanPosition),
        (0..1000u32).prop_map(Refusal::InfinitePosition),
        Just(Refusal::FewPositions),
        Just(Refusal::NanTexel),
        Just(Refusal::BadSetting),
        Just(Refusal::BadOption),
    ];
    prop_oneof![
        4 => Just(Then::Rest),
        2 => Just(Then::Again),
        2 => (2..5u32).prop_map(Then::Threads),
        2 => Just(Then::Alone),
        3 => refusal.prop_map(Then::Refused),
    ]
}
