//! Features at borders that are kept whole (`Seams::Keep`).

use vrtm::{OpenBorders, Seams};

use vrtm_testkit::features::Kind;
use vrtm_testkit::table::{self, judge};
use vrtm_testkit::{long, on_all_cores};

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
