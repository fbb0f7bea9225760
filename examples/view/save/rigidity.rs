//! Saves the painted rigidity, an image per tile.

use std::path::{Path, PathBuf};

use image::ExtendedColorType;

use super::{encode, file};
use crate::brush::canvas::Canvas;

/// The file of each tile: `<name>_rigidity.<UDIM>.png`.
pub fn paths(folder: &Path, name: &str, udims: impl Iterator<Item = u32>) -> Vec<PathBuf> {
    udims.map(|udim| folder.join(format!("{name}_rigidity.{udim}.png"))).collect()
}

/// The file of each tile under a chosen name: of several tiles, with the tile's number.
pub fn paths_of(chosen: &Path, udims: &[u32]) -> Vec<PathBuf> {
    let path = file::with_ending(chosen, "png");
    let [_, _, ..] = udims else { return vec![path] };
    let text = path.display().to_string();
    let pattern = match pattern(&text) {
        same if same == text => format!("{}.<UDIM>.png", text.strip_suffix(".png").unwrap_or(&text)),
        pattern => pattern,
    };
    udims.iter().map(|udim| pattern.replace("<UDIM>", &udim.to_string()).into()).collect()
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
///
/// # Errors
/// What the system says, naming the file.
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
        return encode::encode(canvas.size, ExtendedColorType::L16, bytes);
    }
    // To the nearest of 256 values.
    let bytes: Vec<u8> = canvas.texels.iter().map(|&texel| ((u32::from(texel) + 128) / 257) as u8).collect();
    encode::encode(canvas.size, ExtendedColorType::L8, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::maps::Map;

    #[test]
    fn a_chosen_name_holds_the_numbers_of_tiles() {
        let names = |chosen: &str, udims: &[u32]| {
            let paths = paths_of(Path::new(chosen), udims);
            paths.iter().map(|path| path.display().to_string()).collect::<Vec<_>>()
        };
        assert_eq!(names("a/mine", &[1001]), ["a/mine.png"]);
        assert_eq!(names("a/mine.png", &[1001, 1012]), ["a/mine.1001.png", "a/mine.1012.png"]);
        assert_eq!(names("a/mine.1012.png", &[1001, 1012]), ["a/mine.1001.png", "a/mine.1012.png"]);
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
