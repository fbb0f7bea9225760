//! The command line arguments.

use std::path::PathBuf;

use clap::{Parser, ValueEnum};

/// Bakes UV redirection maps that keep painted features rigid while the mesh under them deforms.
///
/// Without an argument it bakes a built-in scene, a mug that is edited into a jug. Per frame (numbered from 1) and
/// UDIM tile it writes redirect.####.<UDIM>.exr and warp.####.<UDIM>.exr: UVs in the channels R and G, v up, first
/// row = top of the tile. They are data, not colour: read them without a colour space, and with clamped edges. A texture looked up at the redirected UV keeps its rigid
/// features in shape. Per frame it writes sheet.####.png, a picture to judge by, and at the end report.json.
#[derive(Debug, Parser)]
#[command(name = "bake", version, max_term_width = 100)]
pub struct Args {
    /// Folder with asset.json, rest.obj, frames.f32 and rigidity.<UDIM>.png
    #[arg(long, value_name = "DIR", conflicts_with_all = ["rest", "scene"])]
    pub asset: Option<PathBuf>,

    /// Mesh at rest, with UVs
    #[arg(long, value_name = "FILE.obj", requires_all = ["pose", "stiff"], conflicts_with = "scene")]
    pub rest: Option<PathBuf>,

    /// Poses in the order of their frames: each OBJ is one, a .f32 file (little-endian f32, frames x vertices x 3)
    /// as many as it holds; the vertices in the order of the rest mesh
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "rest")]
    pub pose: Vec<PathBuf>,

    /// Where the rest positions come from, if not from --rest: 'first' takes those of the first pose, a file those of its
    /// first one. Faces and UVs are those of --rest in any case
    #[arg(long, value_name = "FILE|first", requires = "rest", value_parser = parse_rest_pose)]
    pub rest_pose: Option<RestPose>,

    /// Rigidity maps, white = rigid: a path in which <UDIM> stands for the tile's number, e.g. 'r.<UDIM>.png'. PNG, JPEG,
    /// TIFF or EXR, of 8, 16 or 32 bits; of colours the luminance counts
    #[arg(long, value_name = "PATTERN", requires = "rest", group = "stiff")]
    pub rigidity: Option<String>,

    /// Warp masks: texels darker than middle grey do not move; a path as for --rigidity
    #[arg(long, value_name = "PATTERN", requires = "rest")]
    pub mask: Option<String>,

    /// Rigidity per vertex in place of maps: a text file with a number per line, in the order of the vertices, an OBJ whose
    /// vertices have colours (v x y z r g b), or 'colors' for the colours of the rest mesh
    #[arg(long, value_name = "FILE|colors", requires = "rest", group = "stiff")]
    pub vertex_rigidity: Option<String>,

    /// Warp mask per vertex in place of maps, as for --vertex-rigidity: what is under 0.5 does not move
    #[arg(long, value_name = "FILE|colors", requires = "rest", conflicts_with = "mask")]
    pub vertex_mask: Option<String>,

    /// Built-in scene: mug_to_jug, creature, arm, squash, bulge, pinch, shear, torus or strips
    #[arg(long, value_name = "NAME")]
    pub scene: Option<String>,

    /// Frames to bake, e.g. 1-3,7 [default: all]
    #[arg(long, value_name = "LIST", value_parser = parse_frames)]
    pub frames: Option<Frames>,

    /// Where to write
    #[arg(long, value_name = "DIR", default_value = "out")]
    pub out: PathBuf,

    /// Also replace existing files that vrtm did not write. Files that the bake reads are never replaced
    #[arg(long)]
    pub overwrite: bool,

    /// Which UVs the redirection holds. tile: within the tile, 0 to 1, for a texture that is looked up tile by tile (Nuke's
    /// STMap, a shader with one texture). udim: with the tile's place added, for a UDIM texture (Blender, Arnold, RenderMan,
    /// Karma), which needs no further node. delta: what to add to the mesh's own UV, with one node, which is right for UVs
    /// that leave the tile, too, and loses least with --half
    #[arg(long, value_enum, default_value = "tile")]
    pub form: Form,

    /// Names of the EXR files, below --out: <kind> stands for redirect, warp and so on, <frame> for at least four digits,
    /// <UDIM> for the tile. The default is what renderers, Painter and Mari want, the tile's number last; Blender takes the
    /// last number for the frame, so that a sequence of one tile wants '<kind>.<UDIM>.<frame>.exr'
    #[arg(long, value_name = "PATTERN", default_value = crate::names::DEFAULT)]
    pub name: String,

    /// Write RGBA, with 1 in A where a chart covers the texel's centre, instead of RGB with 0 in B
    #[arg(long)]
    pub alpha: bool,

    /// Write numbers of 16 bits; in a map of 512 texels or more lines bend visibly, except with --form delta
    #[arg(long)]
    pub half: bool,

    /// Write the redirection at each texel's centre as it is, even where lookups between the texels then fold. Otherwise the
    /// values next to a fold are moved a little, so that there is none
    #[arg(long)]
    pub exact: bool,

    /// Also write jacobian files: du'/du, du'/dv, dv'/du and dv'/dv of the redirection in R, G, B and A, for normal maps
    #[arg(long)]
    pub jacobian: bool,

    /// Also write filter files: by what factor the redirection enlarges a texture filter at most, in R, G and B alike
    #[arg(long)]
    pub filter_scale: bool,

    /// Write no warp files
    #[arg(long)]
    pub no_warp: bool,

    /// Draw no sheets
    #[arg(long)]
    pub no_sheet: bool,

    /// Cells of the grid per side, and texels of the maps unless --map-size says otherwise [default: the rigidity map's
    /// size; 1024 with --vertex-rigidity]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=i64::from(vrtm::MAX_GRID)))]
    pub size: Option<u32>,

    /// Texels of the maps per side: a number, or auto for the smallest power of two at which 99 % of each frame's map, read
    /// bilinearly, is off by at most half a texel of the texture (--texture-size). For auto each frame is solved twice, and
    /// all frames get the same size
    #[arg(long, value_name = "N|auto", value_parser = parse_map_size)]
    pub map_size: Option<MapSize>,

    /// Texels per side of the texture that will be looked up: report.json tells the maps' errors in these, and --map-size
    /// auto goes by them
    #[arg(long, value_name = "N", default_value_t = 4096, value_parser = clap::value_parser!(u32).range(1..=1_048_576))]
    pub texture_size: u32,

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

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Form {
    Tile,
    Udim,
    Delta,
}

#[derive(Clone, Debug)]
pub enum RestPose {
    First,
    File(PathBuf),
}

fn parse_rest_pose(text: &str) -> Result<RestPose, String> {
    Ok(if text == "first" { RestPose::First } else { RestPose::File(text.into()) })
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MapSize {
    Texels(u32),
    Auto,
}

fn parse_map_size(text: &str) -> Result<MapSize, String> {
    match text.parse() {
        _ if text == "auto" => Ok(MapSize::Auto),
        Ok(n) if (1..=vrtm::MAX_GRID).contains(&n) => Ok(MapSize::Texels(n)),
        _ => Err(format!("neither auto nor a number from 1 to {}", vrtm::MAX_GRID)),
    }
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
