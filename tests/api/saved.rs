//! Prepared tiles that are saved and loaded: the same results, and refusal of everything else.

use vrtm::{Asset, Device, ErrorKind, FetchKind, OpenBorders, Quality, Seams, TileSettings};
use vrtm_testkit::scenes::by_name;
use vrtm_testkit::{Model, change_all, fetch, options};

fn model(name: &str) -> Model {
    by_name(name).map(Model::from).expect("a scene of that name")
}

/// Bits of all tiles' warps.
fn warps(asset: &mut Asset, model: &Model) -> Vec<[u32; 2]> {
    asset.solve(model.frame(model.frames.len()), &options(Quality::Normal)).unwrap();
    (0..asset.tile_count())
        .flat_map(|tile| {
            let grid = asset.tile(tile).report().unwrap().grid;
            fetch(asset, tile, FetchKind::Warp, grid.map(|n| n + 1))
        })
        .map(|uv| uv.map(f32::to_bits))
        .collect()
}

fn same_results(device: &Device, grid: u32) {
    type Change = fn(&mut TileSettings);
    let cases: [(&str, Change); 3] = [
        ("bulge", |settings| settings.orientation_density = 1.0),
        ("creature", |_| ()),
        ("arm", |settings| (settings.seams, settings.open_borders) = (Seams::Continue, OpenBorders::Slide)),
    ];
    for (name, change) in cases {
        let model = model(name);
        let make = || {
            let mut asset = model.asset_on(device, grid);
            change_all(&mut asset, change);
            asset
        };
        let mut saved = make();
        let bytes: Vec<_> =
            (0..saved.tile_count()).map(|tile| saved.tile_mut(tile).save().unwrap()).collect();
        let mut loaded = make();
        for (tile, bytes) in bytes.iter().enumerate() {
            loaded.tile_mut(tile).load(bytes).unwrap();
            assert_eq!(loaded.tile_mut(tile).info().unwrap(), saved.tile_mut(tile).info().unwrap(), "{name}");
            assert_eq!(&loaded.tile_mut(tile).save().unwrap(), bytes, "{name}");
        }
        assert!(warps(&mut loaded, &model) == warps(&mut saved, &model), "{name}");
        assert_eq!(loaded.device().info().bytes_held, saved.device().info().bytes_held);
    }
}

vrtm_testkit::on_both! {
    a_loaded_tile_gives_the_same_bits(128),
    a_loaded_tile_gives_the_same_bits_on_a_gpu(64): same_results
}

#[test]
fn other_meshes_maps_and_settings_are_refused() {
    let model = model("bulge");
    let mut asset = model.asset(1, 64);
    let bytes = asset.tile_mut(0).save().unwrap();
    let refused = |asset: &mut Asset| {
        let error = asset.tile_mut(0).load(&bytes).unwrap_err();
        assert_eq!(error.kind, ErrorKind::InvalidArgument);
        assert!(error.message.starts_with("data: it was saved with another"), "{}", error.message);
    };
    refused(&mut model.asset(1, 80));
    let mut moved = model.clone();
    moved.rest[3][0] += 1e-3;
    refused(&mut moved.asset(1, 64));
    let mut painted = model.clone();
    let middle = painted.maps[0].rigidity.len() / 2;
    painted.maps[0].rigidity[middle] ^= 1;
    refused(&mut painted.asset(1, 64));
    let mut masked = model.clone();
    masked.maps[0].mask = Some(vec![255; masked.maps[0].rigidity.len()]);
    refused(&mut masked.asset(1, 64));
    let same = TileSettings { grid: [Some(64); 2], ..TileSettings::default() };
    for settings in [
        TileSettings { smoothness: 0.1, ..same },
        TileSettings { orientation_density: 1.0, ..same },
        TileSettings { seams: Seams::Keep, ..same },
        TileSettings { open_borders: OpenBorders::Slide, ..same },
    ] {
        let mut other = model.asset(1, 64);
        other.tile_mut(0).set_settings(&settings).unwrap();
        refused(&mut other);
    }
    // What a solve alone depends on may differ.
    asset.tile_mut(0).set_settings(&TileSettings { room: 0.1, ..same }).unwrap();
    asset.tile_mut(0).load(&bytes).unwrap();
}

#[test]
fn damaged_bytes_are_refused_and_the_tile_stays() {
    let model = model("bulge");
    let mut asset = model.asset(1, 64);
    let bytes = asset.tile_mut(0).save().unwrap();
    let before = warps(&mut asset, &model);
    let held = asset.device().info().bytes_held;
    let refuse = |asset: &mut Asset, data: &[u8], why: &str| {
        let error = asset.tile_mut(0).load(data).unwrap_err();
        assert!(error.message.starts_with("data: ") && error.message.contains(why), "{}", error.message);
    };
    for length in [0, 7, 8, 12, 55, 56, 100, bytes.len() - 1] {
        refuse(&mut asset, &bytes[..length], "");
    }
    refuse(&mut asset, &[&bytes[..], &[0]].concat(), "were saved");
    for at in (0..bytes.len()).step_by(211) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        refuse(&mut asset, &damaged, "");
    }
    // The one word that the checksum does not tell of: a later version may say something by it.
    for at in 12..16 {
        let mut reserved = bytes.clone();
        reserved[at] = 1;
        refuse(&mut asset, &reserved, "reserved word is not 0");
    }
    let mut newer = bytes.clone();
    newer[8] += 1;
    refuse(&mut asset, &newer, &format!("format {}", newer[8]));
    assert_eq!(asset.device().info().bytes_held, held);
    assert!(warps(&mut asset, &model) == before);
}
