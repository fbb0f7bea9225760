//! The command line arguments.

use std::path::PathBuf;

use clap::Parser;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use vrtm::{Backend, MAX_GRID, Quality};

use crate::failure::Failure;
use crate::source::{Files, Source};

/// Bakes UV redirection maps that keep painted features rigid while the mesh under them deforms.
///
/// Without an argument it bakes a built-in scene, a mug that is edited into a jug. Per frame (numbered from 1) and UDIM
/// tile it writes redirect.####.<UDIM>.exr and warp.####.<UDIM>.exr: UVs in the channels R and G, v up, first row = top
/// of the tile. They are data, not colour: read them without a colour space, and with clamped edges. A texture looked up
/// at the redirected UV keeps its rigid features in shape. Per frame it writes sheet.####.png, a picture to judge by, and
/// at the end turning.png, a film for a browser in which the mesh turns and goes from rest to the frame with the most
/// strain and back, and report.json.
///
/// For production there is `vrtm bake` in bindings/python: it reads USD and Alembic, too, and has many more options.
#[derive(Debug, Parser)]
#[command(name = "bake", version, max_term_width = 100)]
pub struct Args {
    /// Built-in scene: mug_to_jug, creature, arm, squash, bulge, pinch, shear, torus or strips
    #[arg(long, value_name = "NAME")]
    pub scene: Option<String>,

    /// Folder with asset.json, rest.obj, frames.f32 and rigidity.<UDIM>.png
    #[arg(long, value_name = "DIR", conflicts_with_all = ["rest", "scene"])]
    pub asset: Option<PathBuf>,

    /// Mesh at rest, with UVs
    #[arg(long, value_name = "FILE.obj", requires_all = ["pose", "rigidity"], conflicts_with = "scene")]
    pub rest: Option<PathBuf>,

    /// Poses in the order of their frames: each OBJ is one, a .f32 file (little-endian f32, frames x vertices x 3) as many
    /// as it holds; the vertices in the order of the rest mesh
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "rest")]
    pub pose: Vec<PathBuf>,

    /// Rigidity maps, white = rigid: PNGs of 8 or 16 bits, as a path in which <UDIM> stands for the tile's number, e.g.
    /// 'r.<UDIM>.png'
    #[arg(long, value_name = "PATTERN", requires = "rest")]
    pub rigidity: Option<String>,

    /// Frames to bake, e.g. 1-3,7,10-20x2 [default: all]
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    pub frames: Option<Frames>,

    /// Folder to write to
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,

    /// Also replace existing files that vrtm did not write; files that the bake reads are never replaced
    #[arg(long)]
    pub overwrite: bool,

    /// Draw no sheets
    #[arg(long)]
    pub no_sheet: bool,

    /// Draw no film
    #[arg(long)]
    pub no_film: bool,

    /// Camera of the sheets and, at first, of the film, in degrees around the mesh and upward
    #[arg(long, value_name = "YAW,PITCH", value_parser = parse_view, allow_hyphen_values = true)]
    pub view: Option<[f64; 2]>,

    /// Cells of the grid per side [default: as many as resolve the rigid features]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_GRID)))]
    pub size: Option<u32>,

    /// Texels of the redirection maps per side [default: --size, or the rigidity map's texels]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_GRID)))]
    pub map_size: Option<u32>,

    /// Quality of each frame
    #[arg(long, default_value = "normal", value_parser = one_of(QUALITIES))]
    pub quality: Quality,

    /// Start each frame from the one that was baked before it, not from the original UVs
    #[arg(long)]
    pub warm: bool,

    /// Weight that holds each frame to the one before it, against jitter; 0.03 to 0.3 is a useful range
    #[arg(long, value_name = "X", requires = "warm", default_value_t = 0.0)]
    pub temporal_weight: f32,

    /// Device to compute on; auto takes a hardware GPU if there is one, the CPU otherwise
    #[arg(long, default_value = "auto", value_parser = one_of(DEVICES))]
    pub device: Backend,
}

impl Args {
    /// Files to load.
    pub fn files(&self) -> Files {
        Files {
            scene: self.scene.clone(),
            asset: self.asset.clone(),
            rest: self.rest.clone(),
            pose: self.pose.clone(),
            rigidity: self.rigidity.clone(),
        }
    }
}

const QUALITIES: [(&str, Quality); 2] = [("draft", Quality::Draft), ("normal", Quality::Normal)];
const DEVICES: [(&str, Backend); 3] = [("auto", Backend::Auto), ("cpu", Backend::Cpu), ("gpu", Backend::Gpu)];

/// Parses a name into the value that it denotes.
fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [(&'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(|(name, _)| name))
        .map(move |text| all.iter().find(|(name, _)| *name == text).expect("one of the names").1)
}

/// A range of frame numbers.
#[derive(Clone, Copy, Debug)]
pub struct Range {
    pub first: usize,
    pub last: usize,
    pub step: usize,
}

/// Ranges of frame numbers, in the order given. The number of frames is only known once the scene is loaded.
#[derive(Clone, Debug)]
pub struct Frames(pub Vec<Range>);

impl Frames {
    /// Indices of these frames, each once.
    ///
    /// # Errors
    /// A frame that the source does not have.
    pub fn among(&self, source: &Source) -> Result<Vec<usize>, Failure> {
        let count = source.frames.len();
        if let Some(last) = self.0.iter().map(|range| range.last).find(|&last| last > count) {
            let reason = format!("{} has {count} frames", source.name);
            return Err(Failure::named(&format!("--frames {last}"), reason));
        }
        let mut chosen = Vec::new();
        let numbers = self.0.iter().flat_map(|range| (range.first..=range.last).step_by(range.step));
        for index in numbers.map(|number| number - 1) {
            if !chosen.contains(&index) {
                chosen.push(index);
            }
        }
        Ok(chosen)
    }
}

/// Reads the lists that `vrtm bake` reads, but for parts of frames, which no OBJ has.
fn parse_frames(text: &str) -> Result<Frames, String> {
    let whole = |t: &str, what: &str| match t.trim().parse::<usize>() {
        Ok(n) if n > 0 => Ok(n),
        _ => Err(format!("'{}' is not a {what}", t.trim())),
    };
    let number = |t: &str| whole(t, "frame number (they start at 1)");
    let range = |part: &str| {
        let (range, step) =
            part.split_once(['x', ':']).map_or((part, None), |(range, step)| (range, Some(step)));
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        let (first, last) = (number(first)?, number(last)?);
        let step = step.map_or(Ok(1), |step| whole(step, "step, a whole number above 0"))?;
        if first > last { Err(format!("'{part}' runs backwards")) } else { Ok(Range { first, last, step }) }
    };
    text.split(',').map(range).collect::<Result<_, _>>().map(Frames)
}

fn parse_view(text: &str) -> Result<[f64; 2], String> {
    let angle = |t: &str| t.trim().parse::<f64>().ok().filter(|a| a.is_finite());
    let pair = text.split_once(',').and_then(|(yaw, pitch)| Some([angle(yaw)?, angle(pitch)?]));
    pair.ok_or_else(|| "expected two angles in degrees, as in 30,15".to_string())
}

/// Reads the command line. `Err` holds a one-line message; `--help` and `--version` print their text and end the
/// program.
pub fn parse() -> Result<Args, String> {
    Args::try_parse().map_err(|error| {
        use clap::error::ErrorKind;
        if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
            error.exit();
        }
        // clap's message has several lines; those after the blank line describe the usage.
        let text = error.to_string();
        let lines = text.lines().take_while(|line| !line.trim().is_empty()).map(str::trim);
        let line = lines.collect::<Vec<_>>().join(" ");
        format!("{} (see --help)", line.trim_start_matches("error: "))
    })
}
