//! Parts of benches: their beginning and end, and words and numbers of their tables.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use vrtm::Quality;

/// Runs a bench at the repository's root, and tells what has gone wrong.
pub fn main(run: impl FnOnce() -> Result<(), String>) -> ExitCode {
    at_root();
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(message) => {
            eprintln!("{message}");
            ExitCode::FAILURE
        }
    }
}

/// Makes the repository's root the present folder, from that of its package, where cargo runs a bench.
fn at_root() {
    if let Some(package) = std::env::var_os("CARGO_MANIFEST_DIR") {
        std::env::set_current_dir(Path::new(&package).join("..")).expect("the package lies below the root");
    }
}

/// Writes a file, and its folder if it is not there.
///
/// # Errors
/// A file that cannot be written, by its name.
pub fn write(path: &Path, text: &str) -> Result<(), String> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let made = folder.map_or(Ok(()), std::fs::create_dir_all);
    made.and_then(|()| std::fs::write(path, text)).map_err(|error| format!("{}: {error}", path.display()))
}

/// Writes the file of an option `--out`, if it is given.
///
/// # Errors
/// A file that cannot be written, by its name.
pub fn write_out(out: &Option<PathBuf>, text: &str) -> Result<(), String> {
    out.as_ref().map_or(Ok(()), |path| write(path, text))
}

/// The quality of an option's word.
///
/// # Errors
/// Another word.
pub fn quality(word: &str) -> Result<Quality, String> {
    match word {
        "draft" => Ok(Quality::Draft),
        "normal" => Ok(Quality::Normal),
        _ => Err("neither draft nor normal".into()),
    }
}

/// The name of a GPU as a part of a file's name, such as `nvidia-h200`.
pub fn in_file_name(gpu: &str) -> String {
    let words = gpu.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
}

/// The processor's name, if the system provides it.
pub fn processor() -> Option<String> {
    let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
    let line = text.lines().find(|line| line.starts_with("model name"))?;
    Some(line.split_once(':')?.1.trim().to_owned())
}

/// NaN of no values.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let n = sorted.len();
    match n {
        0 => f64::NAN,
        _ if n % 2 == 1 => sorted[n / 2],
        _ => 0.5 * (sorted[n / 2 - 1] + sorted[n / 2]),
    }
}
