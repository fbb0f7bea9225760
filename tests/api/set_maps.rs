//! What is set last does not count, but what is nearer: a tile's maps before the values of the vertices. And values in
//! another range than 0..1 are told of.

use vrtm::{Asset, ImageLayout, ImageView, LogCode, LogLevel, PixelFormat, SolveOptions, Strided};
use vrtm_testkit::log::{Line, listened};
use vrtm_testkit::sixteen::{bulged, discs, sixteen_asset, sixteen_charts};
use vrtm_testkit::{bits, change, cpu, view};

const SIZE: u32 = 64;

/// Maps and settings that a host may set, in any order.
#[derive(Clone, Copy, Debug)]
enum Step {
    Map(bool),
    Mask(bool),
    Vertices(bool),
    VertexMask(bool),
}

fn solved(steps: &[Step]) -> Vec<[u32; 2]> {
    let mut asset = sixteen_asset(&cpu(1), 0.9).unwrap();
    change(&mut asset, 0, |settings| settings.grid = [Some(SIZE), Some(SIZE)]);
    let (rest, ..) = sixteen_charts(0.9);
    let texels = discs(SIZE as usize, 8);
    let mask: Vec<u8> = (0..SIZE * SIZE).map(|k| if k % SIZE < SIZE / 2 { 255 } else { 0 }).collect();
    let rigidity: Vec<f32> = (0..rest.len()).map(|v| (v % 3) as f32 / 2.0).collect();
    let free: Vec<f32> = (0..rest.len()).map(|v| if v < rest.len() / 3 { 0.0 } else { 1.0 }).collect();
    for step in steps {
        match *step {
            Step::Map(is_set) => asset.tile_mut(0).set_rigidity(is_set.then(|| view(&texels, SIZE, SIZE))),
            Step::Mask(is_set) => asset.tile_mut(0).set_mask(is_set.then(|| view(&mask, SIZE, SIZE))),
            Step::Vertices(is_set) => {
                asset.set_vertex_rigidity(is_set.then(|| Strided::from_slice(&rigidity)))
            }
            Step::VertexMask(is_set) => asset.set_vertex_mask(is_set.then(|| Strided::from_slice(&free))),
        }
        .unwrap();
    }
    let pose = bulged(&rest, 1.0);
    asset.solve(Strided::from_slice(&pose), &SolveOptions::default()).unwrap();
    bits(&asset)
}

#[test]
fn a_tile_s_maps_count_before_the_values_of_vertices_in_any_order() {
    use Step::{Map, Mask, VertexMask, Vertices};
    let map = solved(&[Map(true)]);
    let vertices = solved(&[Vertices(true)]);
    assert!(map != vertices && map.iter().any(|u| *u != [0, 0]) && vertices.iter().any(|u| *u != [0, 0]));
    for steps in [
        &[Map(true), Vertices(true)][..],
        &[Vertices(true), Map(true)],
        &[Map(true), Vertices(true), Vertices(false)],
        &[Map(true), Vertices(false)],
    ] {
        assert!(solved(steps) == map, "{steps:?}");
    }
    for steps in [&[Map(true), Vertices(true), Map(false)][..], &[Vertices(true), Map(true), Map(false)]] {
        assert!(solved(steps) == vertices, "{steps:?}");
    }
    let masked = solved(&[Map(true), Mask(true)]);
    let of_vertices = solved(&[Map(true), VertexMask(true)]);
    assert!(masked != map && of_vertices != map && masked != of_vertices);
    assert!(solved(&[Mask(true), VertexMask(true), Map(true)]) == masked);
    assert!(solved(&[VertexMask(true), Mask(true), Map(true), VertexMask(false)]) == masked);
    assert!(solved(&[Mask(true), VertexMask(true), Map(true), Mask(false)]) == of_vertices);
}

#[test]
fn values_in_another_range_are_told_of() {
    let (device, log) = listened();
    let mut asset = sixteen_asset(&device, 0.9).unwrap();
    let mut warnings = |set: &dyn Fn(&mut Asset)| {
        log.take();
        set(&mut asset);
        let warning = |line: Line| {
            let largest = line.values.first().copied().unwrap_or(0.0);
            (line.level == LogLevel::Warning).then(|| (line.code, line.udim, (1e4 * largest).round() / 1e4))
        };
        log.take().into_iter().filter_map(warning).collect::<Vec<_>>()
    };
    let image = |format: PixelFormat, bytes: Vec<u8>| {
        move |asset: &mut Asset| {
            let layout = ImageLayout::packed(SIZE, SIZE, format);
            let image = Some(ImageView::new("map", &bytes, layout).unwrap());
            asset.tile_mut(0).set_rigidity(image).unwrap();
            asset.tile_mut(0).set_mask(image).unwrap();
        }
    };
    let painted = |white: u8| -> Vec<u8> {
        discs(SIZE as usize, 8).into_iter().map(|x| if x > 0 { white } else { 0 }).collect()
    };
    let numbers =
        |white: f32| painted(1).into_iter().flat_map(|x| (f32::from(x) * white).to_ne_bytes()).collect();
    let shorts =
        |white: u16| painted(1).into_iter().flat_map(|x| (u16::from(x) * white).to_ne_bytes()).collect();
    let cases: [(&str, PixelFormat, Vec<u8>, Option<f64>); 9] = [
        ("white", PixelFormat::U8, painted(255), None),
        ("0 and 1", PixelFormat::U8, painted(1), Some(0.0039)),
        ("low", PixelFormat::U8, painted(40), None),
        ("black", PixelFormat::U8, painted(0), None),
        ("16 bits", PixelFormat::U16, shorts(u16::MAX), None),
        ("8 bits in 16", PixelFormat::U16, shorts(255), Some(0.0039)),
        ("floats", PixelFormat::F32, numbers(1.0), None),
        ("an overshoot", PixelFormat::F32, numbers(1.2), None),
        ("0..255", PixelFormat::F32, numbers(255.0), Some(255.0)),
    ];
    for (name, format, bytes, largest) in cases {
        let found = warnings(&image(format, bytes));
        let codes = [LogCode::RigidityRange, LogCode::MaskRange];
        let told = largest.map(|largest| codes.map(|code| (code, Some(1001), largest)));
        assert_eq!(found, told.as_slice().concat(), "{name}");
    }
    let (rest, ..) = sixteen_charts(0.9);
    let pose = bulged(&rest, 1.0);
    let solve =
        |asset: &mut Asset| asset.solve(Strided::from_slice(&pose), &SolveOptions::default()).unwrap();
    let without = |asset: &mut Asset| {
        asset.tile_mut(0).set_rigidity(None).unwrap();
        solve(asset);
        // Once is enough.
        solve(asset);
    };
    let found = warnings(&without);
    assert_eq!(found, [(LogCode::NoRigidity, None, 0.0)]);
    let found = warnings(&|asset| {
        asset.set_vertex_rigidity(Some(Strided::from_slice(&vec![100.0; rest.len()]))).unwrap()
    });
    assert_eq!(found, [(LogCode::RigidityRange, None, 100.0)]);
}
