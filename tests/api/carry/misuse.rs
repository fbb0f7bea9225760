//! Wrong arguments, and the order of calls.

use super::sheet::{Layout, Sheet, by_uv, disc, fetch, lattice, solve};
use super::{bulge, uvs, warped};
use vrtm::{
    Asset, Backend, Bind, Carried, CarrierSettings, Device, DeviceSettings, ErrorKind, Fetch, FetchKind, Fit,
    ImageLayout, ImageViewMut, PixelFormat, Scalar, SolveOptions, Strided, StridedMut, TileSettings,
};

fn sheet() -> Sheet {
    Sheet::new(8, Layout::Whole, bulge)
}

#[test]
fn wrong_arguments_are_named() {
    let asset = sheet().asset(1, 32, |_| 0.0, TileSettings::default());
    let uvs = [[0.5f32, 0.5], [0.4, f32::NAN]];
    let refused = |settings: &CarrierSettings, words: &str| {
        let error = asset.carrier(settings).unwrap_err();
        assert_eq!(error.kind, ErrorKind::InvalidArgument);
        assert!(error.message.contains(words), "{words}: {}", error.message);
    };
    let of = |uvs| CarrierSettings::new(Bind::Uv { uvs: Strided::from_slice(uvs), layers: None });
    refused(&of(&uvs), "uvs[1]: component 1 is NaN");
    let good = of(&uvs[..1]);
    refused(&CarrierSettings { uv_set: 1, ..good }, "uv_set: 1");
    refused(
        &CarrierSettings { heights: Some(Strided::from_slice(&[1.0, 2.0])), ..good },
        "heights: 2 elements",
    );
    refused(&CarrierSettings { heights: Some(Strided::from_slice(&[f32::INFINITY])), ..good }, "heights[0]");
    refused(
        &CarrierSettings { frames: Some(Strided::from_slice(&[[0.0; 3]])), ..good },
        "frames: 3 components",
    );
    refused(&CarrierSettings { pieces: Some(&[1, 2]), ..good }, "pieces: 2 elements");
    refused(&CarrierSettings { skirt: -1.0, ..good }, "skirt: -1");
    refused(&CarrierSettings { skirt: f64::NAN, ..good }, "skirt: NaN");
    let layers = Bind::Uv { uvs: Strided::from_slice(&uvs[..1]), layers: Some(&[]) };
    refused(&CarrierSettings::new(layers), "layers: 0 elements");
    let near = Bind::Nearest { positions: Strided::from_slice(&[[0.0; 3]]), farthest: Some(f64::NAN) };
    refused(&CarrierSettings::new(near), "farthest: NaN");
    let corners = |corners: [u32; 3], weights: &[[f32; 3]], words: &str| {
        let by = Bind::Corners { corners: &[corners], weights: Strided::from_slice(weights) };
        refused(&CarrierSettings::new(by), words);
    };
    corners([0, 1, 4], &[[1.0, 0.0, 0.0]], "corners[0]: 0, 1, 4 are not three corners of one face");
    corners([0, 1, u32::MAX], &[[1.0, 0.0, 0.0]], "not three corners");
    corners([0, 1, 2], &[[1.0, -1.0, 0.0]], "weights[0]: their sum is 0");
    corners([0, 1, 2], &[], "weights: 0 elements");
    for (frame, is_good) in [
        (&[0.0; 4][..], false),
        (&[0.0, 0.0, 1e-30, 0.0], true),
        (&[0.0; 9], false),
        (&[1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 0.0, 0.0, 1.0], false),
        (&[1e-30, 0.0, 0.0, 0.0, 1e30, 0.0, 0.0, 0.0, -1.0], true),
    ] {
        let whole = [&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0][..frame.len()], frame].concat();
        let (quaternions, matrices) = (whole.as_chunks::<4>().0, whole.as_chunks::<9>().0);
        let is_matrix = frame.len() == 9;
        let frames =
            Some(if is_matrix { Strided::from_slice(matrices) } else { Strided::from_slice(quaternions) });
        let settings = CarrierSettings { frames, ..of(&[[0.5, 0.5]; 2]) };
        if is_good {
            asset.carrier(&settings).unwrap();
        } else {
            refused(&settings, "frames[1] is zero, or a matrix whose axes lie in a plane");
        }
    }
    // What is kept as f32 must be within its range.
    let (far, at) = ([[1e39, 0.0, 0.0]], Strided::from_slice(&[1e39]));
    refused(&CarrierSettings { heights: Some(at), ..good }, "heights[0]: component 0 is 1");
    let far = Bind::Nearest { positions: Strided::from_slice(&far), farthest: None };
    refused(&CarrierSettings::new(far), "which is beyond f32");
}

#[test]
fn weights_count_by_their_ratio_and_mirrored_frames_stay_mirrored() {
    let sheet = sheet();
    let mut asset = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), TileSettings::default());
    let weights = [1.0, 1e-7, 1e-300, 1e307, -1e307].map(|unit| [2.0, 3.0, 4.0].map(|x| unit * x));
    let by = |weights| Bind::Corners { corners: &[[0, 1, 2]; 5], weights };
    // Two axes changed, one turned over, and one of them alone.
    let mirrors =
        [[0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0]];
    let frames: Vec<[f64; 9]> = (0..5).map(|k| mirrors[k % 2]).collect();
    let frames = Some(Strided::from_slice(&frames));
    let settings = CarrierSettings { frames, ..CarrierSettings::new(by(Strided::from_slice(&weights))) };
    let carrier = asset.carrier(&settings).unwrap();
    solve(&mut asset, &sheet.rest);
    let all = fetch(&carrier);
    for k in 0..5 {
        assert!(super::distance(all.positions[k], all.positions[0]) < 1e-12, "{k}");
        let apart = |c: usize| (all.rotations[k][c] - mirrors[k % 2][c]).abs();
        assert!((0..9).all(|c| apart(c) < 1e-6), "{k}: {:?}", all.rotations[k]);
    }
}

/// A carrier that is made can be fetched: its creation asks for the room of the first fetch.
#[test]
fn a_budget_refuses_carriers_when_they_are_made() {
    let sheet = sheet();
    let on = |memory_budget: Option<u64>| {
        let settings = DeviceSettings { backend: Backend::Cpu, memory_budget, ..DeviceSettings::default() };
        let mut asset = sheet.asset_on(
            &Device::new(&settings).unwrap(),
            32,
            disc([0.5, 0.5], 0.4),
            TileSettings::default(),
        );
        // The second solve holds two results.
        (0..2).for_each(|_| solve(&mut asset, &sheet.pose(warped)));
        asset
    };
    let held = on(None).device().info().bytes_held;
    let points = uvs(Layout::Whole, &lattice(60));
    let mut made = [0; 2];
    for step in 0..40 {
        let mut asset = on(Some(held + 50_000 + 40_000 * step));
        let pairs: Vec<[f32; 2]> = points.iter().map(|uv| uv.map(|x| x as f32)).collect();
        let by = Bind::Uv { uvs: Strided::from_slice(&pairs), layers: None };
        match asset.carrier(&CarrierSettings::new(by)) {
            Ok(carrier) => {
                solve(&mut asset, &sheet.pose(warped));
                fetch(&carrier);
                made[1] += 1;
            }
            Err(error) => {
                assert!(
                    error.message.starts_with("a carrier with its first fetch needs"),
                    "{}",
                    error.message
                );
                made[0] += 1;
            }
        }
    }
    assert!(made.iter().all(|count| *count > 5), "{made:?}");
}

#[test]
fn a_fetch_needs_a_solve_after_the_carrier_and_fitting_arrays() {
    let sheet = sheet();
    let mut asset = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), TileSettings::default());
    let uvs = uvs(Layout::Whole, &lattice(5));
    let early = by_uv(&asset, &uvs, None, Fit::Feature, 0);
    let mut positions = vec![[7.0f32; 3]; 25];
    let out = Carried { positions: Some(StridedMut::from_slice(&mut positions)), ..Carried::default() };
    assert_eq!(early.fetch(&out).unwrap_err().kind, ErrorKind::NotSolved);
    drop(early);
    solve(&mut asset, &sheet.rest);
    let carrier = by_uv(&asset, &uvs, None, Fit::Feature, 0);
    let error = carrier.fetch(&out).unwrap_err();
    assert_eq!(error.kind, ErrorKind::NotSolved);
    assert!(error.message.contains("no solve since"), "{}", error.message);
    solve(&mut asset, &sheet.pose(warped));
    let short =
        Carried { positions: Some(StridedMut::from_slice(&mut positions[..24])), ..Carried::default() };
    assert!(carrier.fetch(&short).unwrap_err().message.contains("positions: 24 elements"));
    let mut wrong = vec![[0.0f32; 5]; 25];
    let out = Carried { rotations: Some(StridedMut::from_slice(&mut wrong)), ..Carried::default() };
    assert!(carrier.fetch(&out).unwrap_err().message.contains("rotations: 5 components"));
    assert!(positions.iter().all(|p| *p == [7.0; 3]), "nothing is written");
    carrier.fetch(&Carried::default()).unwrap();
    let none = by_uv(&asset, &[], None, Fit::Feature, 0);
    solve(&mut asset, &sheet.rest);
    assert_eq!(fetch(&none).positions.len(), 0);
}

#[test]
fn points_are_an_output_of_a_solve() {
    let sheet = sheet();
    let layout = ImageLayout::packed(8, 8, PixelFormat::F32);
    let mut asset = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), TileSettings::default());
    let carrier = by_uv(&asset, &uvs(Layout::Whole, &lattice(5)), None, Fit::Feature, 0);
    let other = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), TileSettings::default());
    let mut positions = vec![[7.0f64; 3]; 25];
    let mut image = vec![7u8; 8 * 8 * 8];
    let run = |asset: &mut Asset, count: usize, positions: &mut [[f64; 3]], image: &mut [u8]| {
        let positions = Some(StridedMut::from_slice(&mut positions[..count]));
        let image = ImageViewMut::new("image", image, layout).unwrap();
        let mut fetches = [
            Fetch::Carried { carrier: &carrier, carried: Carried { positions, ..Carried::default() } },
            Fetch::Image { tile: 0, kind: FetchKind::Redirection, image },
        ];
        let pose = sheet.pose(warped);
        asset.redirect(Strided::from_slice(&pose), &SolveOptions::default(), &mut fetches)
    };
    let mut refused = |asset: &mut Asset, count: usize, words: &str| {
        let error = run(asset, count, &mut positions, &mut image).unwrap_err();
        assert!(error.message.contains(words), "{}", error.message);
        assert!(positions[0] == [7.0; 3] && image.iter().all(|byte| *byte == 7), "nothing is written");
    };
    refused(&mut { other }, 25, "fetches[0].carrier belongs to another asset");
    refused(&mut asset, 24, "fetches[0].carried.positions: 24 elements");
    assert_eq!(asset.report().unwrap_err().kind, ErrorKind::NotSolved, "nothing is solved");
    run(&mut asset, 25, &mut positions, &mut image).unwrap();
    assert_eq!(positions, fetch(&carrier).positions);
    let mut alone = vec![0u8; 8 * 8 * 8];
    let mut view = ImageViewMut::new("image", &mut alone, layout).unwrap();
    asset.tile(0).fetch(FetchKind::Redirection, &mut view).unwrap();
    assert_eq!(image, alone);
}

#[test]
fn strides_and_formats_are_kept() {
    let sheet = sheet();
    let mut asset = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), TileSettings::default());
    let carrier = by_uv(&asset, &uvs(Layout::Whole, &lattice(6)), None, Fit::Feature, 0);
    solve(&mut asset, &sheet.pose(warped));
    let all = fetch(&carrier);
    let mut bytes = vec![0xAA_u8; 36 * 17];
    let positions = StridedMut::new("positions", &mut bytes, Scalar::F32, 3, 36, 17).unwrap();
    carrier.fetch(&Carried { positions: Some(positions), ..Carried::default() }).unwrap();
    for k in 0..36 {
        for c in 0..3 {
            let at = 17 * k + 4 * c;
            let x = f32::from_ne_bytes(bytes[at..at + 4].try_into().unwrap());
            assert_eq!(x, all.positions[k][c] as f32);
        }
        assert!(bytes[17 * k + 12..17 * k + 17].iter().all(|byte| *byte == 0xAA));
    }
    assert!(StridedMut::new("positions", &mut bytes, Scalar::F64, 3, 36, 17).is_err());
    let mut rotations = vec![[0.0f64; 4]; 36];
    carrier
        .fetch(&Carried { rotations: Some(StridedMut::from_slice(&mut rotations)), ..Carried::default() })
        .unwrap();
    for ([x, y, z, w], m) in rotations.into_iter().zip(&all.rotations) {
        assert!(
            (1.0 - 2.0 * (y * y + z * z) - m[0]).abs() < 1e-12
                && (2.0 * (x * y + w * z) - m[3]).abs() < 1e-12
        );
    }
}

#[test]
fn it_follows_other_grids_and_maps_and_outlives_the_asset() {
    let sheet = sheet();
    let pose = sheet.pose(warped);
    let points = uvs(Layout::Whole, &lattice(9));
    let mut asset = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), TileSettings::default());
    let carrier = by_uv(&asset, &points, None, Fit::Feature, 0);
    solve(&mut asset, &pose);
    let first = fetch(&carrier);
    let settings = TileSettings { grid: [Some(64); 2], ..asset.tile_mut(0).settings().unwrap() };
    asset.tile_mut(0).set_settings(&settings).unwrap();
    assert_eq!(fetch(&carrier), first, "settings change nothing before the next solve");
    solve(&mut asset, &pose);
    let second = fetch(&carrier);
    let mut other = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), settings);
    other.tile_mut(0).set_settings(&settings).unwrap();
    let fresh = by_uv(&other, &points, None, Fit::Feature, 0);
    solve(&mut other, &pose);
    assert!(fetch(&fresh) == second && second != first);
    asset.tile_mut(0).set_rigidity(None).unwrap();
    solve(&mut asset, &pose);
    assert_eq!((fetch(&carrier).uvs.len(), carrier.info().features), (81, 0));
    drop(asset);
    assert_eq!(fetch(&carrier).positions.len(), 81);
    drop(carrier);
}

#[test]
fn bytes_are_on_the_account_and_go_back() {
    let sheet = sheet();
    let mut asset = sheet.asset(1, 32, disc([0.5, 0.5], 0.2), TileSettings::default());
    asset.solve(Strided::from_slice(&sheet.rest), &SolveOptions::default()).unwrap();
    let before = asset.device().info().bytes_held;
    let carrier = by_uv(&asset, &uvs(Layout::Whole, &lattice(40)), None, Fit::Feature, 0);
    let bound = carrier.info().bytes;
    solve(&mut asset, &sheet.rest);
    fetch(&carrier);
    assert!(bound >= 1600 * 32 && carrier.info().bytes > 2 * bound);
    let pose = 24 * sheet.rest.len() as u64;
    assert_eq!(asset.device().info().bytes_held, before + carrier.info().bytes + pose);
    drop(carrier);
    solve(&mut asset, &sheet.rest);
    assert_eq!(asset.device().info().bytes_held, before);
}
