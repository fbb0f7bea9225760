//! The command line arguments.

use std::path::PathBuf;

use clap::Parser;
use vrtm::Backend;
use vrtm_examples::options::{DEVICES, one_of};

use crate::gltf::Choice;
use crate::panel::viewport::Panes;
use crate::source::Files;

/// Shows how painted features keep their shape while a mesh deforms: orbit, scrub, paint what is rigid.
///
/// Without an argument it opens a built-in scene, a mug that turns into a jug. Folders, OBJ and glTF files can also be
/// dropped on the window.
#[derive(Clone, Debug, Parser)]
#[command(name = "vrtm-view", version, max_term_width = 100)]
pub struct Args {
    #[command(flatten)]
    pub files: Files,

    #[command(flatten)]
    pub choice: Choice,

    /// Colour textures to draw with in place of a material made from the rigidity maps: image files, as a path in which
    /// <UDIM> stands for the tile's number; tiles without a file keep that material
    #[arg(long, value_name = "PATTERN")]
    pub texture: Option<String>,

    /// Normal maps in tangent space to light the surface by; green grows with v, as in OpenGL. The path is as that of
    /// --texture
    #[arg(long, value_name = "PATTERN")]
    pub normal: Option<String>,

    /// Backend of solves; auto takes a hardware GPU if there is one, the CPU otherwise
    #[arg(long, default_value = "cpu", value_parser = one_of(DEVICES))]
    pub device: Backend,

    /// Size of the window
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "1600x1000", value_parser = size)]
    pub size: [f32; 2],

    /// Frame of the timeline to begin at: its number, or from 1 where poses have no numbers [default: that of the pose
    /// that stretches most]
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    pub frame: Option<i64>,

    /// View of the surface to begin with
    #[arg(long, default_value = "side-by-side", value_parser = one_of(VIEWS))]
    pub view: Panes,

    /// Write a line of JSON per event to this file: solves, places of widgets, saved files; for tests
    #[arg(long, value_name = "FILE")]
    pub trace: Option<PathBuf>,
}

const VIEWS: [(&str, Panes); 4] = [
    ("original", Panes::Original),
    ("redirected", Panes::Redirected),
    ("side-by-side", Panes::SideBySide),
    ("wipe", Panes::Wipe),
];

fn size(text: &str) -> Result<[f32; 2], String> {
    let side = |t: &str| t.trim().parse::<u16>().ok().filter(|&n| n >= 200).map(f32::from);
    let pair = text.split_once('x').and_then(|(width, height)| Some([side(width)?, side(height)?]));
    pair.ok_or_else(|| "expected two numbers of at least 200, as in 1600x1000".to_string())
}
