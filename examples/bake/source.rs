//! Loads a bake's mesh, poses and maps: from an asset folder, from a user's files, or from a built-in scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::args::{Args, RestPose};
use crate::failure::{Failure, Result, read};
use crate::image_file;
use crate::maps::Map;
use crate::mesh::Mesh;
use crate::obj;
use crate::overwrite::Input;
use crate::scenes::{self, Scene};
use crate::vertices;

/// All that is read before the first solve.
#[derive(Debug)]
pub struct Source {
    pub name: String,
    /// Name of the mesh's file, for messages.
    pub origin: String,
    pub mesh: Mesh,
    /// All existing frames. The sheet's camera considers all of them, so that frames that are baked one by one (on a
    /// farm) can be compared.
    pub frames: Vec<Frame>,
    /// Indices of the frames to bake.
    pub chosen: Vec<usize>,
    /// Maps by UDIM number.
    pub maps: BTreeMap<u32, TileMaps>,
    /// Rigidity and mask per vertex.
    pub vertex_rigidity: Option<Vec<f32>>,
    pub vertex_mask: Option<Vec<f32>>,
    /// Author, licence and source of an asset for the report.
    pub credits: Value,
    /// All files that were read.
    pub inputs: Vec<Input>,
}

#[derive(Debug)]
pub struct Frame {
    /// Counted from 1.
    pub number: usize,
    pub positions: Vec<[f32; 3]>,
    /// Name of the pose's file, for messages.
    pub origin: String,
    pub note: String,
}

#[derive(Debug, Default)]
pub struct TileMaps {
    pub rigidity: Option<Map>,
    pub mask: Option<Map>,
}

impl Source {
    pub fn load(args: &Args) -> Result<Source> {
        let mut source = match (&args.asset, &args.rest) {
            (Some(folder), _) => asset(folder)?,
            (_, Some(rest)) => files(rest, args)?,
            _ => scene(args.scene.as_deref().unwrap_or("mug_to_jug"))?,
        };
        source.choose_frames(args)?;
        for frame in &source.frames {
            check_positions(frame, source.mesh.rest.len())?;
        }
        Ok(source)
    }

    fn choose_frames(&mut self, args: &Args) -> Result<()> {
        let count = self.frames.len();
        self.chosen = match &args.frames {
            Some(wanted) => wanted.0.iter().map(|number| number - 1).collect(),
            None => (0..count).collect(),
        };
        match self.chosen.iter().find(|&&index| index >= count) {
            Some(index) => {
                let argument = format!("--frames {}", index + 1);
                Err(Failure::named(&argument, format!("{} has {count} frames", self.name)))
            }
            None => Ok(()),
        }
    }
}

fn check_positions(frame: &Frame, vertices: usize) -> Result<()> {
    let bad = |reason: String| Err(Failure::named(&frame.origin, reason));
    if frame.positions.len() != vertices {
        return bad(format!("{} vertices, but the rest mesh has {vertices}", frame.positions.len()));
    }
    match frame.positions.iter().position(|p| p.iter().any(|x| !x.is_finite())) {
        Some(i) => {
            bad(format!("frame {}: vertex {} is {:?}, not finite", frame.number, i + 1, frame.positions[i]))
        }
        None => Ok(()),
    }
}

fn scene(name: &str) -> Result<Source> {
    let Some(scene) = scenes::by_name(name) else {
        return Err(Failure::named(
            &format!("--scene {name}"),
            format!("not one of {}", scenes::NAMES.join(", ")),
        ));
    };
    let Scene { name, notes, rest, face_counts, indices, uvs, uv_indices, poses, tiles } = scene;
    let frames = poses.into_iter().enumerate().map(|(i, positions)| Frame {
        number: i + 1,
        positions,
        origin: name.into(),
        note: notes.get(i).copied().unwrap_or_default().into(),
    });
    let maps = tiles.into_iter().map(|tile| {
        let map = |bytes| Map::from_bytes(tile.width, tile.height, bytes, name);
        let maps = TileMaps { rigidity: Some(map(tile.rigidity)), mask: tile.mask.map(map) };
        (tile.udim, maps)
    });
    Ok(Source {
        name: name.into(),
        origin: name.into(),
        mesh: Mesh { rest, face_counts, indices, uvs, uv_indices },
        frames: frames.collect(),
        chosen: Vec::new(),
        maps: maps.collect(),
        vertex_rigidity: None,
        vertex_mask: None,
        credits: Value::Null,
        inputs: Vec::new(),
    })
}

fn asset(folder: &Path) -> Result<Source> {
    let path = folder.join("asset.json");
    let json: Value = serde_json::from_slice(&read(&path)?).map_err(|e| Failure::file(&path, e))?;
    let rest = folder.join("rest.obj");
    let mesh = obj::load_mesh(&rest)?;
    let mut frames = Vec::new();
    let poses = folder.join("frames.f32");
    let mut inputs = [&path, &rest, &poses].map(|path| ("--asset", path.clone())).to_vec();
    load_f32(&poses, mesh.rest.len(), &mut frames)?;
    // The size of a file that was truncated between two frames is still a multiple of a frame's.
    if let Some(count) = json["frames"].as_u64().filter(|&count| count != frames.len() as u64) {
        return Err(Failure::file(&poses, format!("{} frames, but asset.json says {count}", frames.len())));
    }
    for frame in &mut frames {
        frame.note = json["frame_notes"][frame.number - 1].as_str().unwrap_or_default().into();
    }
    let present = mesh.udims();
    let mut maps: BTreeMap<u32, TileMaps> = BTreeMap::new();
    for (kind, field) in [("rigidity", true), ("mask", false)] {
        for (udim, file) in json[kind].as_object().into_iter().flatten() {
            let bad = || Failure::file(&path, format!("\"{kind}\" should map UDIM numbers to file names"));
            let udim: u32 = udim.parse().map_err(|_| bad())?;
            let file = folder.join(file.as_str().ok_or_else(bad)?);
            let map = image_file::load(&file)?;
            inputs.push(("--asset", file));
            if present.contains(&udim) {
                let tile = maps.entry(udim).or_default();
                *(if field { &mut tile.rigidity } else { &mut tile.mask }) = Some(map);
            }
        }
    }
    let folder_name = || folder.file_name().map_or("asset".into(), |n| n.to_string_lossy().into_owned());
    let credits = ["author", "licence", "licence_url", "source"];
    Ok(Source {
        name: json["name"].as_str().map_or_else(folder_name, str::to_string),
        origin: rest.display().to_string(),
        mesh,
        frames,
        chosen: Vec::new(),
        maps,
        vertex_rigidity: None,
        vertex_mask: None,
        credits: credits.iter().map(|&key| (key.to_string(), json[key].clone())).collect(),
        inputs,
    })
}

fn files(rest: &Path, args: &Args) -> Result<Source> {
    let mut mesh = obj::load_mesh(rest)?;
    let mut frames = Vec::new();
    let mut inputs = vec![("--rest", rest.to_path_buf())];
    for path in &args.pose {
        inputs.push(("--pose", path.clone()));
        load_poses(path, &mesh, &mut frames)?;
    }
    let mut at_rest = Vec::new();
    let first = match &args.rest_pose {
        Some(RestPose::First) => frames.first(),
        Some(RestPose::File(path)) => {
            inputs.push(("--rest-pose", path.clone()));
            load_poses(path, &mesh, &mut at_rest)?;
            at_rest.first()
        }
        None => None,
    };
    if let Some(first) = first {
        check_positions(first, mesh.rest.len())?;
        mesh.rest = first.positions.clone();
    }
    let mut of_vertices = |option, name: &Option<String>| {
        let Some(name) = name else { return Ok(None) };
        let path = if name == "colors" { rest } else { Path::new(name) };
        inputs.push((option, path.into()));
        vertices::load(path, mesh.rest.len()).map(Some)
    };
    let vertex_rigidity = of_vertices("--vertex-rigidity", &args.vertex_rigidity)?;
    let vertex_mask = of_vertices("--vertex-mask", &args.vertex_mask)?;
    let udims: Vec<u32> = mesh.udims().into_iter().collect();
    let mut maps: BTreeMap<u32, TileMaps> = BTreeMap::new();
    for (option, pattern) in [("--rigidity", &args.rigidity), ("--mask", &args.mask)] {
        let Some(pattern) = pattern else { continue };
        for (udim, path) in existing(option, pattern, &udims)? {
            let map = Some(image_file::load(&path)?);
            let tile = maps.entry(udim).or_default();
            *(if option == "--mask" { &mut tile.mask } else { &mut tile.rigidity }) = map;
            inputs.push((option, path));
        }
    }
    Ok(Source {
        name: rest.file_stem().map_or("mesh".into(), |n| n.to_string_lossy().into_owned()),
        origin: rest.display().to_string(),
        mesh,
        frames,
        chosen: Vec::new(),
        maps,
        vertex_rigidity,
        vertex_mask,
        credits: Value::Null,
        inputs,
    })
}

/// The existing files of a pattern, one per tile; a path without `<UDIM>` serves a mesh with one tile.
fn existing(argument: &str, pattern: &str, udims: &[u32]) -> Result<Vec<(u32, PathBuf)>> {
    if !pattern.contains("<UDIM>") {
        let [udim] = udims else {
            let reason = format!("the mesh has {} tiles: write <UDIM> for the tile's number", udims.len());
            return Err(Failure::named(&format!("{argument} {pattern}"), reason));
        };
        return Ok(vec![(*udim, pattern.into())]);
    }
    let mut found = Vec::new();
    for &udim in udims {
        let path = PathBuf::from(pattern.replace("<UDIM>", &udim.to_string()));
        // A folder that cannot be looked into is no folder without maps.
        if path.try_exists().map_err(|e| Failure::file(&path, e))? {
            found.push((udim, path));
        }
    }
    if found.is_empty() {
        return Err(Failure::named(pattern, format!("no such file for any of the mesh's tiles {udims:?}")));
    }
    Ok(found)
}

/// Appends the poses of a file: an OBJ has one, a .f32 file one or more.
fn load_poses(path: &Path, mesh: &Mesh, frames: &mut Vec<Frame>) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("f32")) {
        return load_f32(path, mesh.rest.len(), frames);
    }
    let positions = obj::load_positions(path, mesh)?;
    let note = path.file_stem().map_or(String::new(), |n| n.to_string_lossy().into_owned());
    frames.push(Frame { number: frames.len() + 1, positions, origin: path.display().to_string(), note });
    Ok(())
}

/// Reads little-endian f32, frames x vertices x 3, and appends the frames.
fn load_f32(path: &Path, vertices: usize, frames: &mut Vec<Frame>) -> Result<()> {
    let bytes = read(path)?;
    let frame = vertices * 12;
    if bytes.is_empty() || bytes.len() % frame != 0 {
        let reason = format!(
            "{} bytes are not a whole number of frames of {vertices} vertices ({frame} bytes each)",
            bytes.len()
        );
        return Err(Failure::file(path, reason));
    }
    for frame in bytes.chunks_exact(frame) {
        let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let positions = frame.chunks_exact(12).map(|p| [float(p), float(&p[4..]), float(&p[8..])]);
        frames.push(Frame {
            number: frames.len() + 1,
            positions: positions.collect(),
            origin: path.display().to_string(),
            note: String::new(),
        });
    }
    Ok(())
}
