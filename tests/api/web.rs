//! Maps that the npm package must give bit for bit, too: bindings/web/tests/bits.test.mjs computes the same hashes.
//! Written anew with `VRTM_UPDATE_BITS=1 cargo test --test api web::`.

use std::fmt::Write;

use vrtm::{FetchKind, ImageLayout, PixelFormat, Quality, SolveOptions};
use vrtm_testkit::{Model, cpu, options, raw, scenes};

/// FNV-1a of 32 bits.
fn hash(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, &byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

#[test]
fn maps_have_the_bits_of_the_npm_package() {
    let efforts = [
        ("draft", options(Quality::Draft)),
        ("normal", options(Quality::Normal)),
        ("warm", SolveOptions { warm: true, ..SolveOptions::default() }),
    ];
    let mut found =
        String::from("# Written by tests/api/web.rs: scene | options | hash of the maps of all tiles.\n");
    for scene in ["mug_to_jug", "creature", "squash"] {
        let model = Model::from(scenes::by_name(scene).unwrap());
        let mut asset = model.asset_on(&cpu(1), 128);
        for (name, options) in &efforts {
            asset.solve(model.frame(model.frames.len()), options).unwrap();
            let maps: Vec<u8> = (0..asset.tile_count())
                .flat_map(|tile| {
                    let layout = ImageLayout::packed(96, 96, PixelFormat::F32);
                    raw(&asset, tile, FetchKind::Redirection, layout, 96 * 96 * 8, 0)
                })
                .collect();
            writeln!(found, "{scene} | {name} | {:08x}", hash(&maps)).unwrap();
        }
    }
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../bindings/web/tests/bits.txt");
    if std::env::var_os("VRTM_UPDATE_BITS").is_some_and(|value| value == "1") {
        std::fs::write(&file, &found).unwrap();
    }
    assert_eq!(found, std::fs::read_to_string(&file).unwrap(), "{}", file.display());
}
