//! Writes a built-in scene as the folder of an asset, which the examples, the viewer and the benches open.
//!
//! `cargo run --release --example scene -- mug_to_jug out/mug_to_jug`

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Parser;
use clap::builder::PossibleValuesParser;
use vrtm_testkit::{save, scenes};

/// Writes a built-in scene as a folder with asset.json, rest.obj, frames.f32 and rigidity maps.
#[derive(Parser)]
#[command(version, max_term_width = 100)]
struct Args {
    /// Built-in scene.
    #[arg(value_parser = PossibleValuesParser::new(scenes::NAMES))]
    scene: String,
    /// Folder; a file of an earlier asset there is replaced.
    folder: PathBuf,
}

fn main() -> ExitCode {
    let args = Args::parse();
    let Some(scene) = scenes::by_name(&args.scene) else { return ExitCode::FAILURE };
    match save::save(&scene, scene.name, &args.folder) {
        Ok(()) => ExitCode::SUCCESS,
        Err(line) => {
            eprintln!("scene: {line}");
            ExitCode::FAILURE
        }
    }
}
