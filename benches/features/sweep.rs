//! One line per scene and setting: the error of the features, and how smoothly the warp follows the pose.

use std::time::Instant;

use vrtm::{OpenBorders, Quality, Seams, Strided, TileSettings};
use vrtm_testkit::Lab as _;

use vrtm_testkit::features::{at_texels, of_asset, rms};
use vrtm_testkit::roughness::second_difference;
use vrtm_testkit::{Model, options};

pub const HEAD: &str = "| scene | setting | ms | features | RMS strain before | after | mean after | over 0.05 before | after | worse by 0.02 | worst | second difference, cells |
|---|---|---|---|---|---|---|---|---|---|---|---|
";

/// Changes the settings by a word such as `room=0`; `default` changes nothing.
pub fn change(settings: &mut TileSettings, word: &str) -> Result<(), String> {
    let bad = || format!("--settings {word}: neither 'default' nor NAME=VALUE of a tile's setting");
    let Some((name, text)) = word.split_once('=') else {
        return if word == "default" { Ok(()) } else { Err(bad()) };
    };
    match name {
        "open_borders" if text == "slide" => settings.open_borders = OpenBorders::Slide,
        "seams" if text == "continue" => settings.seams = Seams::Continue,
        "seams" if text == "keep" => settings.seams = Seams::Keep,
        _ => *settings.number(name).ok_or_else(bad)? = text.parse().map_err(|_| bad())?,
    }
    Ok(())
}

/// Parts of the way from rest to the frame at which the second difference is taken.
const WAY: [f64; 4] = [0.92, 0.925, 0.93, 0.935];

/// The line of a scene and of settings that are changed by the words of `setting`, joined by `+`.
pub fn row(
    model: &Model,
    frame: usize,
    setting: &str,
    grid: u32,
    at_the_texels: bool,
) -> Result<String, String> {
    let pose = &model.frames[frame - 1];
    let options = options(Quality::Normal);
    let mut asset = model.asset(0, grid);
    for tile in 0..asset.tile_count() {
        let mut settings = asset.settings(tile).map_err(|error| error.to_string())?;
        for word in setting.split('+') {
            change(&mut settings, word)?;
        }
        asset.set_settings(tile, &settings).map_err(|error| error.to_string())?;
    }
    let mut warp = |t: f64| -> Result<Vec<[f64; 2]>, String> {
        let point = |(r, p): (&[f32; 3], &[f32; 3])| {
            [0, 1, 2].map(|k| f64::from(r[k]) + t * (f64::from(p[k]) - f64::from(r[k])))
        };
        let between: Vec<[f64; 3]> = model.rest.iter().zip(pose).map(point).collect();
        asset.solve(Strided::from_f64x3(&between), &options).map_err(|error| error.to_string())?;
        let of_tile = |tile| asset.displacements(tile).map_err(|error| error.to_string());
        let tiles: Result<Vec<_>, String> = (0..asset.tile_count()).map(of_tile).collect();
        Ok(tiles?.iter().flatten().map(|u| u.map(f64::from)).collect())
    };
    let warps = WAY.iter().map(|&t| warp(t)).collect::<Result<Vec<_>, String>>()?;
    let moving: Vec<usize> =
        (0..warps[0].len()).filter(|&n| warps.iter().any(|warp| warp[n] != [0.0; 2])).collect();
    let of_steps = warps.windows(3).flat_map(|w| moving.iter().map(|&n| second_difference(w, n)));
    let second = rms(of_steps);
    let start = Instant::now();
    asset.solve(Strided::from_f32x3(pose), &options).map_err(|error| error.to_string())?;
    let ms = 1000.0 * start.elapsed().as_secs_f64();
    let features = if at_the_texels { at_texels } else { of_asset }(model, pose, &asset);
    let [before, after] = [0, 1].map(|k| features.iter().map(move |f| [f.before, f.after][k]));
    let bad = |errors: &mut dyn Iterator<Item = f64>| errors.filter(|error| *error > 0.05).count();
    let rise = || features.iter().map(|f| f.after - f.before);
    Ok(format!(
        "| {} {frame} | {setting} | {ms:.0} | {} | {:.4} | {:.4} | {:.4} | {} | {} | {} | {:.3} | {second:.4} |\n",
        model.name,
        features.len(),
        rms(before.clone()),
        rms(after.clone()),
        after.clone().sum::<f64>() / features.len().max(1) as f64,
        bad(&mut before.clone()),
        bad(&mut after.clone()),
        rise().filter(|rise| *rise > 0.02).count(),
        rise().fold(0.0, f64::max),
    ))
}
