//! Features at borders that are kept whole (`Seams::Keep`).

use vrtm::{Asset, OpenBorders, Seams, SolveOptions};

use vrtm_testkit::features::{Kind, set_borders};
use vrtm_testkit::table::{self, judge};
use vrtm_testkit::{Model, bits, change, cpu, long, on_all_cores, view};

/// At borders features are what they are without a warp; the others keep their shapes as they do with shut seams.
#[test]
fn features_at_borders_are_kept_and_others_keep_their_shape() {
    let names = ["creature", "mh_face", "spot", "cesium_man", "fox", "ict_inner", "strips"];
    let cases: Vec<_> =
        names.iter().filter_map(|name| Some((table::model(name)?, table::frame(name)))).collect();
    let cases = long::share(cases, 3, "scenes");
    let lines = on_all_cores(&cases, |&(model, frame)| {
        let [kept, shut] =
            [Seams::Keep, Seams::Shut].map(|seams| judge(model, frame, (seams, OpenBorders::Fixed)));
        let at_borders = || kept.features.iter().filter(|feature| feature.kind != Kind::Inner);
        let change = at_borders().map(|feature| (feature.after - feature.before).abs()).fold(0.0, f64::max);
        let [of_kept, of_shut] = [&kept, &shut].map(|judged| judged.of(Kind::Inner));
        let line = format!(
            "{} {frame}: {} change {change:.4}, {of_kept:?}, {of_shut:?}",
            model.name,
            at_borders().count()
        );
        let holds =
            change < 1e-6 && of_kept.worse <= of_shut.worse && of_kept.mean[1] <= 1.1 * of_shut.mean[1];
        (line, holds)
    });
    lines.iter().for_each(|(line, _)| println!("{line}"));
    let failed: Vec<_> = lines.into_iter().filter(|(_, holds)| !holds).map(|(line, _)| line).collect();
    assert!(failed.is_empty(), "\n{}", failed.join("\n"));
}

fn with(model: &Model, seams: Seams) -> Asset {
    let mut asset = model.asset_on(&cpu(2), 256);
    set_borders(&mut asset, (seams, OpenBorders::Fixed));
    asset
}

fn solved(asset: &mut Asset, model: &Model) -> Vec<[u32; 2]> {
    asset.solve(model.frame(1), &SolveOptions::default()).unwrap();
    bits(asset)
}

/// After a stroke of the brush, another setting or saved bytes an asset is as one that begins so.
#[test]
fn what_is_kept_follows_maps_and_settings() {
    let model = Model::from(vrtm_testkit::scenes::by_name("strips").unwrap());
    let maps = &model.maps[0];
    let mut asset = with(&model, Seams::Keep);
    let kept = solved(&mut asset, &model);
    let fixed = asset.tile_mut(0).info().unwrap().fixed;
    assert!(fixed > 0.99, "all features of the scene end at a border: {fixed}");
    let saved = asset.tile_mut(0).save().unwrap();
    let mut other = with(&model, Seams::Shut);
    let shut = solved(&mut other, &model);
    assert!(kept != shut);
    assert!(other.tile_mut(0).load(&saved).unwrap_err().message.contains("another mesh, map or setting"));
    change(&mut other, 0, |settings| settings.seams = Seams::Keep);
    other.tile_mut(0).load(&saved).unwrap();
    assert!(solved(&mut other, &model) == kept);

    // Strips that are cut in their middle no longer hang together with the border.
    let [width, height] = [maps.width, maps.height];
    let cut: Vec<u8> = (0..width * height)
        .map(|k| match (k % width * 16 / width, k / width * 16 / height) {
            (3 | 4 | 11 | 12, _) | (_, 3 | 4 | 11 | 12) => 0,
            _ => maps.rigidity[k as usize],
        })
        .collect();
    let image = |bytes| view(bytes, width, height);
    asset.tile_mut(0).update_rigidity(image(&cut), [0, 0], [width, height]).unwrap();
    let after = solved(&mut asset, &model);
    let mut fresh = with(&model, Seams::Keep);
    fresh.tile_mut(0).set_rigidity(Some(image(&cut))).unwrap();
    assert!(after == solved(&mut fresh, &model));
    let now = asset.tile_mut(0).info().unwrap().fixed;
    assert!(now < 0.9 * fixed, "{now}");
}
