//! Loads a mesh, its poses and maps: from a built-in scene, from an asset folder, or from a user's files.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use clap::builder::PossibleValuesParser;
use serde_json::Value;

use crate::failure::{Failure, Result, read};
use crate::maps::Map;
use crate::mesh::{Mesh, Positions};
use crate::obj;
use vrtm_testkit::scenes::{self, Scene};

/// The options that name the files to load. Without any it is a built-in scene.
#[derive(clap::Args, Clone, Debug, Default, PartialEq)]
pub struct Files {
    /// Built-in scene
    #[arg(long, value_name = "NAME", value_parser = PossibleValuesParser::new(scenes::NAMES))]
    pub scene: Option<String>,

    /// Folder with asset.json, rest.obj, frames.f32 and rigidity.<UDIM>.png
    #[arg(long, value_name = "DIR", conflicts_with_all = ["rest", "scene"])]
    pub asset: Option<PathBuf>,

    /// Mesh at rest, with UVs: an OBJ file; the viewer also reads glTF files (.gltf, .glb), which have their own poses
    /// and textures
    #[arg(long, value_name = "FILE", conflicts_with = "scene")]
    pub rest: Option<PathBuf>,

    /// Poses in the order of their frames: each OBJ is one, a .f32 file (little-endian f32, frames x vertices x 3) as
    /// many as it holds; the vertices in the order of the rest mesh. The viewer takes numbers in the names of OBJ
    /// files, as in walk.0101.obj, for those of the frames
    #[arg(long, value_name = "FILE", num_args = 1.., requires = "rest")]
    pub pose: Vec<PathBuf>,

    /// Rigidity maps, white = rigid: PNGs of 8 or 16 bits, as a path in which <UDIM> stands for the tile's number, e.g.
    /// 'r.<UDIM>.png' [default: nothing is rigid]
    #[arg(long, value_name = "PATTERN", requires = "rest")]
    pub rigidity: Option<String>,
}

/// Everything that is read before the first solve.
#[derive(Debug, Default)]
pub struct Source {
    pub name: String,
    /// Name of the mesh's file, for messages.
    pub origin: String,
    pub mesh: Mesh,
    pub frames: Vec<Frame>,
    /// Maps by UDIM number.
    pub maps: BTreeMap<u32, TileMaps>,
    /// All files that were read.
    pub inputs: Vec<PathBuf>,
}

#[derive(Debug)]
pub struct Frame {
    /// Number of the frame, counted from 1.
    pub number: usize,
    pub positions: Positions,
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
    pub fn load(wanted: &Files) -> Result<Source> {
        let source = match (&wanted.asset, &wanted.rest) {
            (Some(folder), _) => asset(folder)?,
            (_, Some(rest)) => files(rest, wanted)?,
            _ => scene(wanted.scene.as_deref().unwrap_or("mug_to_jug"))?,
        };
        let vertices = source.mesh.rest.len();
        for Frame { number, positions, origin, .. } in &source.frames {
            let bad = |reason: String| Err(Failure::named(origin, reason));
            if positions.len() != vertices {
                return bad(format!("{} vertices, but the rest mesh has {vertices}", positions.len()));
            }
            if let Some((i, p)) = (1..).zip(positions.iter()).find(|(_, p)| p.iter().any(|x| !x.is_finite()))
            {
                return bad(format!("frame {number}: vertex {i} is {p:?}, not finite"));
            }
        }
        Ok(source)
    }
}

fn scene(name: &str) -> Result<Source> {
    let Some(scene) = scenes::by_name(name) else {
        let reason = format!("not one of {}", scenes::NAMES.join(", "));
        return Err(Failure::named(&format!("--scene {name}"), reason));
    };
    let Scene { notes, rest, face_counts, indices, uvs, uv_indices, poses, tiles, .. } = scene;
    let frames = poses.into_iter().enumerate().map(|(i, positions)| Frame {
        number: i + 1,
        positions: Positions::F32(positions),
        origin: name.into(),
        note: notes.get(i).copied().unwrap_or_default().into(),
    });
    let maps = tiles.into_iter().map(|tile| {
        let (size, format, origin) = ([tile.width, tile.height], vrtm::PixelFormat::U8, name.to_string());
        let map = |bytes| Map { size, format, bytes, origin: origin.clone() };
        (tile.udim, TileMaps { rigidity: Some(map(tile.rigidity)), mask: tile.mask.map(map) })
    });
    Ok(Source {
        name: name.into(),
        origin: name.into(),
        mesh: Mesh { rest: Positions::F32(rest), face_counts, indices, uvs, uv_indices },
        frames: frames.collect(),
        maps: maps.collect(),
        ..Source::default()
    })
}

fn asset(folder: &Path) -> Result<Source> {
    let [path, rest, poses] = ["asset.json", "rest.obj", "frames.f32"].map(|name| folder.join(name));
    let json: Value = serde_json::from_slice(&read(&path)?).map_err(|e| Failure::file(&path, e))?;
    let mut mesh = obj::load_mesh(&rest)?;
    // As the frames are: a frame that is the rest pose is exactly that.
    mesh.rest = Positions::F32(mesh.rest.around([0.0; 3]));
    let mut frames = Vec::new();
    load_f32(&poses, mesh.rest.len(), &mut frames)?;
    // If a file was truncated between two frames, its size is still a multiple of a frame's.
    if let Some(count) = json["frames"].as_u64().filter(|&count| count != frames.len() as u64) {
        return Err(Failure::file(&poses, format!("{} frames, but asset.json says {count}", frames.len())));
    }
    for frame in &mut frames {
        frame.note = json["frame_notes"][frame.number - 1].as_str().unwrap_or_default().into();
    }
    let mut inputs = [&path, &rest, &poses].map(PathBuf::clone).to_vec();
    let mut maps: BTreeMap<u32, TileMaps> = BTreeMap::new();
    for kind in ["rigidity", "mask"] {
        for (udim, file) in json[kind].as_object().into_iter().flatten() {
            let bad = || Failure::file(&path, format!("\"{kind}\" should map UDIM numbers to file names"));
            let tile = maps.entry(udim.parse().map_err(|_| bad())?).or_default();
            let file = folder.join(file.as_str().ok_or_else(bad)?);
            *(if kind == "mask" { &mut tile.mask } else { &mut tile.rigidity }) = Some(Map::load(&file)?);
            inputs.push(file);
        }
    }
    let present: BTreeSet<u32> = mesh.faces().filter_map(|face| mesh.udim(face)).collect();
    maps.retain(|udim, _| present.contains(udim));
    let folder = folder.file_name().map_or("asset".into(), |name| name.to_string_lossy().into_owned());
    Ok(Source {
        name: json["name"].as_str().map_or(folder, str::to_string),
        origin: rest.display().to_string(),
        mesh,
        frames,
        maps,
        inputs,
    })
}

fn files(rest: &Path, wanted: &Files) -> Result<Source> {
    let mesh = obj::load_mesh(rest)?;
    let mut inputs = vec![rest.to_path_buf()];
    let mut frames = Vec::new();
    for path in &wanted.pose {
        inputs.push(path.clone());
        if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("f32")) {
            load_f32(path, mesh.rest.len(), &mut frames)?;
            continue;
        }
        let positions = obj::load_positions(path, &mesh)?;
        let note = path.file_stem().map_or(String::new(), |name| name.to_string_lossy().into_owned());
        frames.push(Frame { number: frames.len() + 1, positions, origin: path.display().to_string(), note });
    }
    let maps = rigidity(wanted, &mesh, &mut inputs)?;
    Ok(Source {
        name: rest.file_stem().map_or("mesh".into(), |name| name.to_string_lossy().into_owned()),
        origin: rest.display().to_string(),
        mesh,
        frames,
        maps,
        inputs,
    })
}

/// Reads the maps of a mesh, and adds their files to the inputs.
pub fn rigidity(wanted: &Files, mesh: &Mesh, inputs: &mut Vec<PathBuf>) -> Result<BTreeMap<u32, TileMaps>> {
    let mut maps = BTreeMap::new();
    let found = wanted.rigidity.as_ref().map(|pattern| existing(pattern, mesh)).transpose()?;
    for (udim, path) in found.unwrap_or_default() {
        maps.insert(udim, TileMaps { rigidity: Some(Map::load(&path)?), mask: None });
        inputs.push(path);
    }
    Ok(maps)
}

/// The existing files of a pattern, one per tile; a path without a token serves a mesh with one tile.
pub fn existing(pattern: &str, mesh: &Mesh) -> Result<BTreeMap<u32, PathBuf>> {
    let failure = |reason: String| Failure::named(&format!("--rigidity {pattern}"), reason);
    let path = |udim: u32| (udim, PathBuf::from(tiled(pattern, udim)));
    let mut found: BTreeMap<_, _> = mesh.faces().filter_map(|face| mesh.udim(face)).map(path).collect();
    let count = found.len();
    if count == 0 {
        return Err(failure(
            "none of the mesh's faces lies in a tile: u begins at 0 and ends at 10, v begins at 0".into(),
        ));
    }
    if found.values().collect::<BTreeSet<_>>().len() < count {
        return Err(failure(format!("the mesh has {count} tiles: write <UDIM> for the tile's number")));
    }
    if count > 1 || pattern.contains(['<', '%', '$', '#']) {
        // Keep paths that cannot be checked; reading them reports the error.
        found.retain(|_, path| path.try_exists().unwrap_or(true));
    }
    match found.is_empty() {
        true => Err(failure(format!("no such file for any of the mesh's {count} tiles; {TOKENS}"))),
        false => Ok(found),
    }
}

const TOKENS: &str = "the tokens of a tile are <UDIM>, <UVTILE>, u<U>_v<V> and %(UDIM)d";

/// A pattern with a tile's number in the place of its tokens, as `vrtm bake` fills them in (docs/bake.md).
fn tiled(pattern: &str, udim: u32) -> String {
    let [u, v] = [(udim - 1001) % 10, (udim - 1001) / 10];
    let (udim, from_1, from_0) = (udim.to_string(), format!("u{}_v{}", u + 1, v + 1), format!("u{u}_v{v}"));
    let mut text = pattern.to_string();
    for (token, filled) in [
        ("<UDIM>", &udim),
        ("<udim>", &udim),
        ("%(UDIM)d", &udim),
        ("<UVTILE>", &from_1),
        ("%(UVTILE)d", &from_1),
        ("<uvtile>", &from_0),
    ] {
        text = text.replace(token, filled);
    }
    for (token, letter, number) in
        [("<U>", "u", u + 1), ("<u>", "u", u), ("<V>", "v", v + 1), ("<v>", "v", v)]
    {
        while let Some(at) = text.find(token) {
            // Where no letter is written, the token brings one.
            let mut before = text[..at].chars().rev().map(|c| c.to_ascii_lowercase());
            let is_written = before.next().is_some_and(|c| "uv".contains(c))
                && !before.next().is_some_and(|c| c.is_ascii_alphabetic());
            let filled = format!("{}{number}", if is_written { "" } else { letter });
            text.replace_range(at..at + token.len(), &filled);
        }
    }
    text
}

/// Reads little-endian f32, frames x vertices x 3, and appends the frames.
fn load_f32(path: &Path, vertices: usize, frames: &mut Vec<Frame>) -> Result<()> {
    let bytes = read(path)?;
    let each = vertices * 12;
    if bytes.is_empty() || bytes.len() % each != 0 {
        let length = bytes.len();
        let reason = format!(
            "{length} bytes are not a whole number of frames of {vertices} vertices ({each} bytes each)"
        );
        return Err(Failure::file(path, reason));
    }
    for frame in bytes.chunks_exact(each) {
        let float = |b: &[u8]| f32::from_le_bytes([b[0], b[1], b[2], b[3]]);
        let positions = frame.chunks_exact(12).map(|p| [float(p), float(&p[4..]), float(&p[8..])]).collect();
        let (number, origin) = (frames.len() + 1, path.display().to_string());
        frames.push(Frame { number, positions: Positions::F32(positions), origin, note: String::new() });
    }
    Ok(())
}
