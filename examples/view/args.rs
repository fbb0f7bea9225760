//! The command line arguments.

use std::path::PathBuf;

use clap::Parser;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use vrtm::Backend;

use crate::carry::Shape;
use crate::gltf::Choice;
use crate::panel::viewport::Panes;
use crate::source::Files;
use crate::timeline::RATE;
use vrtm_testkit::scenes;

/// Shows how painted features keep their shape while a mesh deforms: orbit, scrub, paint what is rigid.
///
/// Without an argument it opens a built-in scene, a mug that turns into a jug. Folders, OBJ and glTF files can also be
/// dropped on the window.
#[derive(Clone, Debug, Parser)]
#[command(name = "vrtm-view", version, max_term_width = 100)]
pub struct Args {
    /// Built-in scene
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(scenes::NAMES))]
    pub scene: Option<String>,

    /// Folder with asset.json, rest.obj, frames.f32 and rigidity.<UDIM>.png
    #[arg(long, value_name = "DIR", conflicts_with_all = ["rest", "scene"])]
    pub asset: Option<PathBuf>,

    /// Mesh at rest, with UVs: an OBJ file, without poses to paint on it; or a glTF file (.gltf, .glb), which has its
    /// own poses and textures
    #[arg(long, value_name = "FILE", conflicts_with = "scene")]
    pub rest: Option<PathBuf>,

    /// Mesh of a glTF file, by its name [default: the largest]
    #[arg(long, value_name = "NAME", requires = "rest")]
    pub mesh: Option<String>,

    /// Animation of a glTF file, by its name [default: the longest]
    #[arg(long, value_name = "NAME", requires = "rest")]
    pub animation: Option<String>,

    /// Frames per second of the timeline, of clips, and of the poses from a glTF file's animation
    #[arg(long, value_name = "N", default_value_t = RATE, value_parser = clap::value_parser!(u16).range(1..=240))]
    pub fps: u16,

    /// Poses in the order of the timeline: each OBJ is one, a .f32 file (little-endian f32, frames x vertices x 3) as
    /// many as it holds; the vertices in the order of the rest mesh. Numbers in the names of OBJ files, as in
    /// walk.0101.obj, are those of the frames
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "rest")]
    pub pose: Vec<PathBuf>,

    /// Rigidity maps, white = rigid: PNGs of 8 or 16 bits, as a path in which <UDIM> stands for the tile's number, e.g.
    /// 'r.<UDIM>.png' [default: paint them]
    #[arg(long, value_name = "PATTERN", requires = "rest")]
    pub rigidity: Option<String>,

    /// Colour textures to draw with in place of a material made from the rigidity maps: image files, as a path in which
    /// <UDIM> stands for the tile's number; tiles without a file keep that material
    #[arg(long, value_name = "PATTERN")]
    pub texture: Option<String>,

    /// Normal maps in tangent space to light the surface by; green grows with v, as in OpenGL. The path is as that of
    /// --texture
    #[arg(long, value_name = "PATTERN")]
    pub normal: Option<String>,

    /// Geometry on each feature, as it is bound to the skin without vrtm on the left, and as vrtm carries it on the
    /// right [default: what the built-in scene has]
    #[arg(long, value_parser = one_of(Shape::ALL))]
    pub carried: Option<Shape>,

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

const DEVICES: [(&str, Backend); 3] = [("auto", Backend::Auto), ("cpu", Backend::Cpu), ("gpu", Backend::Gpu)];
const VIEWS: [(&str, Panes); 4] = [
    ("original", Panes::Original),
    ("redirected", Panes::Redirected),
    ("side-by-side", Panes::SideBySide),
    ("wipe", Panes::Wipe),
];

impl Args {
    /// The files to open.
    pub fn files(&self) -> Files {
        Files {
            scene: self.scene.clone(),
            asset: self.asset.clone(),
            rest: self.rest.clone(),
            pose: self.pose.clone(),
            rigidity: self.rigidity.clone(),
        }
    }

    /// The part of a glTF file to open.
    pub fn choice(&self) -> Choice {
        Choice { mesh: self.mesh.clone(), animation: self.animation.clone(), rate: self.fps }
    }
}

/// Parses a name into the value that it denotes.
fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [(&'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(|(name, _)| name))
        .map(move |text| all.iter().find(|(name, _)| *name == text).expect("one of the names").1)
}

fn size(text: &str) -> Result<[f32; 2], String> {
    let side = |t: &str| t.trim().parse::<u16>().ok().filter(|&n| n >= 200).map(f32::from);
    let pair = text.split_once('x').and_then(|(width, height)| Some([side(width)?, side(height)?]));
    pair.ok_or_else(|| "expected two numbers of at least 200, as in 1600x1000".to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_two_numbers() {
        assert_eq!(size("1600x1000"), Ok([1600.0, 1000.0]));
        for text in ["1600", "x", "100x1000", "1600x-5", "axb"] {
            assert!(size(text).is_err(), "{text}");
        }
    }

    #[test]
    fn all_values_are_taken() {
        let all =
            ["vrtm-view", "--view", "side-by-side", "--device", "gpu", "--size", "800x600", "--frame", "3"];
        let args = Args::try_parse_from(all).expect("valid");
        assert_eq!((args.view, args.device, args.frame), (Panes::SideBySide, Backend::Gpu, Some(3)));
    }

    #[test]
    fn wrong_arguments_are_named() {
        let says = |list: &[&str]| {
            let all = [&["vrtm-view"], list].concat();
            Args::try_parse_from(all).expect_err("should fail").to_string()
        };
        assert!(says(&["--scene", "nothing"]).contains("--scene"));
        assert!(says(&["--pose", "a.obj"]).contains("--rest"));
        assert!(says(&["--size", "3"]).contains("--size"));
        assert!(says(&["--fps", "0"]).contains("--fps"));
        assert!(says(&["--animation", "Walk"]).contains("--rest"));
    }
}
