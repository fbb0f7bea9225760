//! Parts of benches: their beginning and end, and words and numbers of their tables.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use vrtm::Quality;
use vrtm_cpu::{ProcessorLevel, forced, processor_level};

use crate::{Model, scenes};

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
pub fn write(path: &Path, text: &str) -> Result<(), String> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    let made = folder.map_or(Ok(()), std::fs::create_dir_all);
    made.and_then(|()| std::fs::write(path, text)).map_err(|error| format!("{}: {error}", path.display()))
}

/// Writes the file of an option `--out`, if it is given.
pub fn write_out(out: &Option<PathBuf>, text: &str) -> Result<(), String> {
    out.as_ref().map_or(Ok(()), |path| write(path, text))
}

/// The quality of an option's word.
pub fn quality(word: &str) -> Result<Quality, String> {
    match word {
        "draft" => Ok(Quality::Draft),
        "normal" => Ok(Quality::Normal),
        _ => Err("neither draft nor normal".into()),
    }
}

/// A scene whose pose can be moved a little, so that each solve is a new one.
pub fn model(name: &str) -> Model {
    let mut model = Model::from(scenes::by_name(name).expect("the name of a built-in scene"));
    let frame = model.frames.len().min(5) - 1;
    let pose = model.frames[frame].clone();
    let (first, rest) = (pose[0], &model.rest);
    let moved =
        pose.iter().zip(rest).map(|(p, r)| [0, 1, 2].map(|k| p[k] + 1e-3 * (r[k] - first[k]))).collect();
    model.frames = vec![pose, moved];
    model
}

/// Runs a bench with the kernels of a processor level, such as `avx2`, or without a word of the highest.
///
/// # Errors
/// A level that the processor lacks, or the build.
pub fn at_level<R>(word: Option<&str>, run: impl FnOnce() -> R) -> Result<R, String> {
    let is_meant = |level: &ProcessorLevel| word.is_none_or(|w| format!("{level:?}").eq_ignore_ascii_case(w));
    let level = forced::LEVELS.iter().rfind(|level| is_meant(level)).ok_or("no such level is built")?;
    forced::at_most(*level, || {
        if word.is_some() && processor_level() != *level {
            return Err(format!("the processor has no {level:?}"));
        }
        Ok(run())
    })
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
