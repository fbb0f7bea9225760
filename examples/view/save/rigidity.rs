//! Saves the painted rigidity, an image per tile.

use std::path::{Path, PathBuf};

use image::ExtendedColorType;

use super::encode;
use crate::brush::canvas::Canvas;

/// The file of each tile: `<name>_rigidity.<UDIM>.png`.
pub fn paths(folder: &Path, name: &str, udims: impl Iterator<Item = u32>) -> Vec<PathBuf> {
    udims.map(|udim| folder.join(format!("{name}_rigidity.{udim}.png"))).collect()
}

/// A path in which `<UDIM>` stands for the four digits of a tile's number, if its name has them.
pub fn pattern(path: &str) -> String {
    let parts: Vec<&str> = path.split('.').collect();
    let is_udim = |part: &&str| part.parse::<u32>().is_ok_and(|n| (1001..=9999).contains(&n));
    match parts.iter().rposition(is_udim) {
        Some(k) => parts
            .iter()
            .enumerate()
            .map(|(j, part)| if j == k { "<UDIM>" } else { part })
            .collect::<Vec<_>>()
            .join("."),
        None => path.into(),
    }
}

/// Writes all maps, with as many bits as those that were opened.
pub fn save(paths: &[PathBuf], canvases: &[Canvas]) -> Result<(), String> {
    for (path, canvas) in paths.iter().zip(canvases) {
        let bytes = encoded(canvas).map_err(|error| format!("{}: {error}", path.display()))?;
        vrtm_examples::whole::write(path, &bytes)?;
    }
    Ok(())
}

fn encoded(canvas: &Canvas) -> image::ImageResult<Vec<u8>> {
    if canvas.deep {
        let bytes = bytemuck::cast_slice(&canvas.texels);
        return encode(canvas.size, ExtendedColorType::L16, bytes);
    }
    // To the nearest of 256 values.
    let bytes: Vec<u8> = canvas.texels.iter().map(|&texel| ((u32::from(texel) + 128) / 257) as u8).collect();
    encode(canvas.size, ExtendedColorType::L8, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maps::Map;

    #[test]
    fn the_number_of_a_tile_is_that_in_a_name() {
        assert_eq!(pattern("a/mine.1012.png"), "a/mine.<UDIM>.png");
        assert_eq!(pattern("maps.2020/r.png"), "maps.2020/r.png");
    }

    #[test]
    fn what_is_saved_is_what_is_opened() {
        let folder = std::env::temp_dir().join(format!("vrtm-view-rigidity-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let shallow =
            Canvas { size: [3, 2], texels: [0, 1, 2, 100, 254, 255].map(|x| x * 257).to_vec(), deep: false };
        let deep = Canvas { size: [2, 2], texels: vec![0, 1, 300, 65535], deep: true };
        let all = paths(&folder, "a", [1001, 1002].into_iter());
        assert!(all[1].ends_with("a_rigidity.1002.png"));
        save(&all, &[shallow.clone(), deep.clone()]).expect("saved");
        let opened = |path: &Path| Canvas::new(Some(&Map::load(path).expect("opened")));
        assert_eq!([opened(&all[0]), opened(&all[1])], [shallow, deep]);
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
