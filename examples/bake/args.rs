//! The command line arguments.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};

/// Bakes UV redirection maps that keep painted features rigid while the mesh under them deforms.
///
/// Without an argument it bakes a built-in scene, a mug that is edited into a jug. Per frame (numbered from 1) and
/// UDIM tile it writes redirect.####.<UDIM>.exr and warp.####.<UDIM>.exr: absolute UVs within the tile in the
/// channels R and G, v up, first row = top of the tile. A texture looked up at the redirected UV keeps its rigid
/// features in shape. Per frame it writes sheet.####.png, a picture to judge by, and at the end report.json.
#[derive(Debug, Parser)]
#[command(name = "bake", version, max_term_width = 100)]
pub struct Args {
    /// Folder with asset.json, rest.obj, frames.f32 and rigidity.<UDIM>.png
    #[arg(long, value_name = "DIR", conflicts_with_all = ["rest", "scene"])]
    pub asset: Option<PathBuf>,

    /// Mesh at rest, with UVs
    #[arg(long, value_name = "FILE.obj", requires_all = ["pose", "rigidity"], conflicts_with = "scene")]
    pub rest: Option<PathBuf>,

    /// Poses in the order of their frames: each OBJ is one, a .f32 file (little-endian f32, frames x vertices x 3)
    /// as many as it holds; the vertices in the order of the rest mesh
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "rest")]
    pub pose: Vec<PathBuf>,

    /// Rigidity maps, white = rigid: a path in which <UDIM> stands for the tile's number, e.g. 'r.<UDIM>.png'
    #[arg(long, value_name = "PATTERN", requires = "rest")]
    pub rigidity: Option<String>,

    /// Warp masks: texels darker than middle grey do not move; a path as for --rigidity
    #[arg(long, value_name = "PATTERN", requires = "rest")]
    pub mask: Option<String>,

    /// Built-in scene: mug_to_jug, creature, arm, squash, bulge, pinch, shear, torus or strips
    #[arg(long, value_name = "NAME")]
    pub scene: Option<String>,

    /// Frames to bake, e.g. 1-3,7 [default: all]
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    pub frames: Option<Frames>,

    /// Where to write
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,

    /// Cells of the grid and texels of the redirection map, per side [default: the rigidity map's size]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(vrtm::MAX_GRID)))]
    pub size: Option<u32>,

    /// How much work
    #[arg(long, value_enum, default_value = "normal")]
    pub quality: Quality,

    /// How the warp is found: descent, or the paper's position-based dynamics, to compare with
    #[arg(long, value_enum, default_value = "descent")]
    pub solver: Solver,

    /// Iterations per level of the grid, for --solver pbd [default: 16]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=1024))]
    pub iterations: Option<u32>,

    /// By what faces hang together: the vertices' indices; also their positions, for meshes out of games, whose vertices
    /// are doubled along hard edges; off: only where UVs are exactly equal, too
    #[arg(long, value_enum, default_value = "index")]
    pub weld: Weld,

    /// Start each frame from the one that was baked before it, not from the original UVs
    #[arg(long)]
    pub warm: bool,

    /// How strongly each frame is held to the one before it, against jitter; 0.03 to 0.3 is a useful range
    #[arg(long, value_name = "X", requires = "warm", default_value_t = 0.0)]
    pub temporal_weight: f32,

    /// Where to compute; auto takes a hardware GPU if there is one, the CPU otherwise
    #[arg(long, value_enum, default_value = "auto")]
    pub device: Device,

    /// Which GPU, numbered from 0, for --device gpu
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub adapter: u32,

    /// CPU threads; 0 = one per core
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub threads: u32,

    /// Camera of the sheet in degrees [default: chosen to show where rigid features are strained]
    #[arg(long, value_name = "YAW,PITCH", value_parser = parse_view, allow_hyphen_values = true)]
    pub view: Option<(f64, f64)>,

    /// Which axis of the mesh points up in the sheet [default: z if the mesh stands on z = 0, else y]
    #[arg(long, value_enum)]
    pub up: Option<Up>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Quality {
    Draft,
    Normal,
    High,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Solver {
    Descent,
    Pbd,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Weld {
    Index,
    Position,
    Off,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Device {
    Auto,
    Cpu,
    Gpu,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Up {
    Y,
    Z,
}

impl From<Quality> for vrtm::Quality {
    fn from(quality: Quality) -> Self {
        match quality {
            Quality::Draft => vrtm::Quality::Draft,
            Quality::Normal => vrtm::Quality::Normal,
            Quality::High => vrtm::Quality::High,
        }
    }
}

impl From<Solver> for vrtm::Solver {
    fn from(solver: Solver) -> Self {
        match solver {
            Solver::Descent => vrtm::Solver::Descent,
            Solver::Pbd => vrtm::Solver::Pbd,
        }
    }
}

impl From<Weld> for vrtm::Weld {
    fn from(weld: Weld) -> Self {
        let by = match weld {
            Weld::Index => vrtm::WeldBy::Index,
            Weld::Position => vrtm::WeldBy::Position,
            Weld::Off => vrtm::WeldBy::Off,
        };
        vrtm::Weld { by, ..vrtm::Weld::default() }
    }
}

impl From<Device> for vrtm::Backend {
    fn from(device: Device) -> Self {
        match device {
            Device::Auto => vrtm::Backend::Auto,
            Device::Cpu => vrtm::Backend::Cpu,
            Device::Gpu => vrtm::Backend::Gpu,
        }
    }
}

/// Parses frame numbers, in the order given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frames(pub Vec<usize>);

fn parse_frames(text: &str) -> Result<Frames, String> {
    let number = |t: &str| match t.trim().parse::<usize>() {
        Ok(n) if (1..=999_999).contains(&n) => Ok(n),
        _ => Err(format!("'{}' is not a frame number (they start at 1)", t.trim())),
    };
    let mut frames = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (first, last) = (number(first)?, number(last)?);
        if last < first {
            return Err(format!("'{part}' runs backwards"));
        }
        for frame in first..=last {
            if !frames.contains(&frame) {
                frames.push(frame);
            }
        }
    }
    Ok(Frames(frames))
}

fn parse_view(text: &str) -> Result<(f64, f64), String> {
    let angle = |t: &str| t.trim().parse::<f64>().ok().filter(|a| a.is_finite());
    let pair = text.split_once(',').and_then(|(yaw, pitch)| Some((angle(yaw)?, angle(pitch)?)));
    pair.ok_or_else(|| "expected two angles in degrees, as in 30,15".to_string())
}

/// Reads the command line. `Err` holds a message of one line; `--help` and `--version` print and end the program.
pub fn parse() -> Result<Args, String> {
    Args::try_parse().map_err(|error| {
        use clap::error::ErrorKind;
        if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) {
            error.exit();
        }
        // clap's message has several lines; those after the blank line are usage.
        let text = error.to_string();
        let lines = text.lines().take_while(|line| !line.trim().is_empty()).map(str::trim);
        let line = lines.collect::<Vec<_>>().join(" ");
        format!("{} (see --help)", line.trim_start_matches("error: "))
    })
}
