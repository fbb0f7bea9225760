//! glTF files: a mesh with its skin and its morph targets, sampled into poses, with its textures.

mod file;
mod geometry;
mod motion;
mod nodes;
mod pictures;
mod rig;
mod subject;
#[cfg(test)]
mod tests;
mod uri;

use std::path::Path;

use crate::failure::{Failure, Result};
use crate::mesh::{Mesh, Positions};
use crate::source::{self, Files, Frame, Source};
use crate::timeline::RATE;
use file::File;
use geometry::Geometry;
use motion::Animation;
use nodes::Nodes;
use pictures::OfTiles;
use rig::Rig;

/// The part of a file to open.
#[derive(Clone, Debug, PartialEq, clap::Args)]
pub struct Choice {
    /// Mesh of a glTF file, by its name [default: all]
    #[arg(long, value_name = "NAME", requires = "rest")]
    pub mesh: Option<String>,

    /// Animation of a glTF file, by its name [default: the longest]
    #[arg(long, value_name = "NAME", requires = "rest")]
    pub animation: Option<String>,

    /// Frames per second of the timeline, and of the poses from a glTF file's animation
    #[arg(long = "fps", value_name = "N", default_value_t = RATE)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..=240))]
    pub rate: u16,
}

impl Default for Choice {
    fn default() -> Choice {
        Choice { mesh: None, animation: None, rate: RATE }
    }
}

/// Names of what a file holds, and what of it is open.
pub struct Contents {
    pub meshes: Vec<String>,
    pub mesh: usize,
    pub animations: Vec<String>,
    pub animation: Option<usize>,
}

/// An opened file; of one that is no glTF, its source alone.
#[derive(Default)]
pub struct Opened {
    pub source: Source,
    pub contents: Option<Contents>,
    /// Numbers of the poses' frames, if they are those of an animation.
    pub numbers: Option<Vec<i64>>,
    pub pictures: OfTiles,
    /// A texture that cannot be read.
    pub notice: Option<String>,
}

/// True if a path is that of a glTF file.
pub fn is_gltf(path: &Path) -> bool {
    path.extension().is_some_and(|e| ["gltf", "glb", "vrm"].iter().any(|end| e.eq_ignore_ascii_case(end)))
}

/// Opens a file.
pub fn load(path: &Path, files: &Files, choice: &Choice) -> Result<Opened> {
    if !files.pose.is_empty() {
        return Err(Failure::named("--pose", format!("{} has its own poses", path.display())));
    }
    let name = path.file_stem().map_or("mesh".into(), |name| name.to_string_lossy().into_owned());
    let mut opened = read(path, choice).map_err(|reason| Failure::file(path, reason))?;
    let source = &mut opened.source;
    (source.name, source.origin) = (name, path.display().to_string());
    source.maps = source::rigidity(files, &source.mesh, &mut source.inputs)?;
    opened.notice = opened.notice.map(|reason| Failure::file(path, reason).0);
    Ok(opened)
}

fn read(path: &Path, choice: &Choice) -> std::result::Result<Opened, String> {
    let mut file = File::open(path)?;
    let nodes = Nodes::new(&file.root)?;
    let subjects = subject::list(&file, &nodes)?;
    let mesh = subject::choose(&subjects, choice.mesh.as_deref())?;
    let geometry = Geometry::read(&file, &nodes, &subjects[mesh])?;
    let animations = motion::names(&file.root);
    let animation = match &choice.animation {
        None => motion::longest(&file)?,
        Some(name) => Some(
            animations
                .iter()
                .position(|other| other == name)
                .ok_or_else(|| format!("no animation \"{name}\"; there are: {}", animations.join(", ")))?,
        ),
    };
    let rig = Rig::new(&file, &nodes, &geometry);
    let rest = rig.rest();
    let (poses, numbers) = match animation {
        Some(index) => {
            let (poses, numbers) = rig.frames(&Animation::read(&file, index)?, choice.rate.into())?;
            (poses, Some(numbers))
        }
        None => (rig.shapes(), None),
    };
    for (name, points) in poses.iter().map(|pose| (pose.name.as_str(), &pose.points)).chain([("rest", &rest)])
    {
        if let Some(vertex) = points.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
            return Err(format!("{name}: vertex {vertex} is not finite"));
        }
    }
    let frames = (1..).zip(poses).map(|(number, pose)| Frame {
        number,
        positions: Positions::F32(pose.points),
        origin: path.display().to_string(),
        note: pose.name,
    });
    let frames = frames.collect();
    let (pictures, notice) = pictures::read(&mut file, &geometry.materials);
    let inputs = file.read;
    let mesh_of_all = Mesh { rest: Positions::F32(rest), ..geometry.mesh };
    let source = Source { mesh: mesh_of_all, frames, inputs, ..Source::default() };
    let meshes = subjects.into_iter().map(|subject| subject.name).collect();
    let contents = Some(Contents { meshes, mesh, animations, animation });
    Ok(Opened { source, contents, numbers, pictures, notice })
}
