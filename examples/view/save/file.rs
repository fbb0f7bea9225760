//! Files to write that exist already.

use std::path::{Path, PathBuf};

/// Of some files, those that exist, as they are told to the user.
pub fn existing(paths: &[PathBuf], inputs: &[PathBuf]) -> Vec<String> {
    let real = |path: &Path| path.canonicalize().ok();
    let inputs: Vec<_> = inputs.iter().filter_map(|input| real(input)).collect();
    let there = paths.iter().filter(|path| path.symlink_metadata().is_ok());
    let one = |path: &PathBuf| {
        let is_input = real(path).is_some_and(|path| inputs.contains(&path));
        format!("{}{}", path.display(), if is_input { " (this was opened)" } else { "" })
    };
    there.map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_exist_are_told_with_those_that_were_opened() {
        let folder = std::env::temp_dir().join(format!("vrtm-view-file-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        let path = folder.join("a.txt");
        std::fs::write(&path, "old").expect("written");
        let said = existing(&[path.clone(), folder.join("b.txt")], &[folder.join(".").join("a.txt")]);
        assert!(said.len() == 1 && said[0].ends_with("a.txt (this was opened)"), "{said:?}");
        std::fs::remove_dir_all(&folder).expect("removed");
    }
}
