//! Opening a mesh.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use eframe::egui::Ui;
use serde_json::json;

use super::dialogs::{Ask, Told};
use super::{App, Open};
use crate::brush::canvas::Canvas;
use crate::brush::painter::Painter;
use crate::draw::beyond;
use crate::draw::camera::Orbit;
use crate::draw::scene::Scene;
use crate::failure::Failure;
use crate::gltf::{Choice, is_gltf};
use crate::maps::Map;
use crate::model::Model;
use crate::panel::figures::History;
use crate::pictures::{self, Pictures, Textures};
use crate::save::rigidity::pattern;
use crate::solve::inbox::Edit;
use crate::source::{self, Files};

impl App {
    /// Opens files. If that fails, what was open stays; poses for the mesh that is open leave what is painted.
    pub(super) fn open_files(&mut self, files: &Files) {
        self.open_part(files, &Choice { rate: self.rate, ..Choice::default() });
    }

    /// Opens a part of files.
    pub(super) fn open_part(&mut self, files: &Files, choice: &Choice) {
        let model = match Model::layered(files, choice, self.settings.overlaps.layers()) {
            Ok(model) => model,
            Err(failure) => return self.say(failure.0),
        };
        let same = |open: &&mut Open| {
            let before = &open.model.files;
            let maps = (&before.scene, &before.asset, &before.rest, &before.rigidity);
            maps == (&files.scene, &files.asset, &files.rest, &files.rigidity)
                && open.model.choice.mesh == choice.mesh
                && open.model.triangles.len() == model.triangles.len()
                && open.model.pages.len() == model.pages.len()
        };
        let kept = self.open.as_mut().filter(same).map(|open| {
            let painter = std::mem::take(&mut open.painter).for_model(&model);
            (painter, std::mem::take(&mut open.pictures), open.inputs.clone())
        });
        let (painter, pictures, inputs) =
            kept.unwrap_or_else(|| (Painter::new(&model), model.pictures.clone(), Vec::new()));
        self.begin(Arc::new(model), painter, pictures);
        if let Some(open) = &mut self.open {
            open.inputs.extend(inputs);
        }
    }

    fn begin(&mut self, model: Arc<Model>, painter: Painter, pictures: Pictures) {
        self.notice = None;
        let scene = self.scene_of(&model, &painter.canvases, &pictures);
        self.flow.edit += 1;
        self.worker.inbox.post(Edit::Open(model.clone(), painter.canvases.clone()));
        let udims: Vec<u32> = model.pages.iter().map(|page| page.udim).collect();
        let facts = json!({ "name": model.name, "tiles": udims, "poses": model.frames.len() });
        self.trace.event("open", facts);
        self.shown = None;
        self.history = History::default();
        self.screen.changed();
        let mut line = model.timeline.clone();
        line.rate = self.rate;
        // What one sees first is what there is to see.
        line.go(line.keys[model.most_stretched()]);
        self.open = Some(Open {
            line,
            orbit: Orbit::of(&model.rest, model.centre, model.radius),
            framed: None,
            first: self.flow.edit,
            painter,
            scene,
            pictures,
            inputs: model.inputs.clone(),
            model: model.clone(),
        });
        if let Some(notice) = &model.notice {
            self.say(notice.clone());
        }
    }

    /// Opens rigidity maps for the mesh that is open, in the place of what is painted.
    pub(super) fn open_rigidity(&mut self, pattern: &str) {
        let Some(open) = &mut self.open else { return self.say(NO_MESH.into()) };
        let read = source::existing(pattern, &open.model.mesh).and_then(|found| {
            let map = |(udim, path): (u32, PathBuf)| Ok((udim, Map::load(&path)?, path));
            found.into_iter().map(map).collect::<Result<Vec<_>, Failure>>()
        });
        let read = match read {
            Ok(read) => read,
            Err(failure) => return self.say(failure.0),
        };
        let mut canvases = open.painter.canvases.clone();
        for (page, canvas) in open.model.pages.iter().zip(&mut canvases) {
            if let Some((_, map, path)) = read.iter().find(|(udim, ..)| *udim == page.udim) {
                *canvas = Canvas::new(Some(map));
                open.inputs.push(path.clone());
            }
        }
        open.painter.replace(canvases);
        self.flow.edit += 1;
        self.worker.inbox.post(Edit::Open(open.model.clone(), open.painter.canvases.clone()));
        self.notice = None;
        self.draw_anew();
    }

    /// Opens colour textures or normal maps for the mesh that is open.
    pub(super) fn open_picture(&mut self, ask: Ask, pattern: &str) {
        let Some(open) = &mut self.open else { return self.say(NO_MESH.into()) };
        let of = if ask == Ask::Normal { &mut open.pictures.normals } else { &mut open.pictures.colours };
        match textures_of(&open.model, pattern) {
            Ok(textures) => *of = textures,
            Err(message) => return self.say(message),
        }
        self.notice = None;
        self.draw_anew();
    }

    /// Hands maps and textures to the GPU once more.
    pub(super) fn draw_anew(&mut self) {
        let Some(mut open) = self.open.take() else { return };
        open.scene = self.scene_of(&open.model, &open.painter.canvases, &open.pictures);
        if let Some(answer) = &self.shown {
            open.scene.show(&self.gpu, answer);
        }
        self.open = Some(open);
        self.screen.changed();
    }

    /// The mesh on the GPU. Where seams continue, textures show what lies beyond them.
    fn scene_of(&mut self, model: &Model, canvases: &[Canvas], pictures: &Pictures) -> Scene {
        let of = |reach| Scene::new(&self.gpu, model, canvases, pictures, reach);
        let scene = of(beyond::reach(&self.settings.tile));
        match scene {
            Ok(scene) => scene,
            Err(error) => {
                let scene = of(None).expect("without a reach vrtm is not asked");
                self.say(error.message);
                scene
            }
        }
    }

    /// Opens what was dropped on the window: a folder is an asset; a glTF file has all; OBJ files are rest and its
    /// poses, in the order of their names; a PNG is a rigidity map, or with colours a texture.
    pub(super) fn open_dropped(&mut self, ui: &Ui) {
        let dropped = ui.input(|i| i.raw.dropped_files.clone());
        let mut paths: Vec<PathBuf> = dropped.iter().map(|file| file.path().into()).collect();
        if paths.is_empty() {
            return;
        }
        paths.sort();
        if self.open.is_some() && paths.iter().all(|path| ends(path, "png")) {
            let pattern = pattern(&paths[0].display().to_string());
            return if is_coloured(&paths[0]) {
                self.open_picture(Ask::Texture, &pattern)
            } else {
                self.open_rigidity(&pattern)
            };
        }
        match files_of(&paths, self.open.as_ref().map(|open| &open.model.files)) {
            Ok(files) => self.open_files(&files),
            Err(message) => self.say(message),
        }
    }

    /// Opens a folder, an OBJ or a glTF file.
    pub(super) fn open_path(&mut self, path: PathBuf) {
        let files = if ends(&path, "obj") || is_gltf(&path) {
            Files { rest: Some(path), ..Files::default() }
        } else {
            Files { asset: Some(path), ..Files::default() }
        };
        self.open_files(&files);
    }

    /// Does what a dialog was shown for.
    pub(super) fn open_told(&mut self, (ask, said): Told) {
        let mut paths = match said {
            Ok(paths) => paths,
            Err(message) => return self.say(message),
        };
        paths.sort();
        let Some(path) = paths.first().cloned() else { return };
        let text = path.display().to_string();
        match ask {
            Ask::Rest | Ask::Asset => self.open_path(path),
            Ask::Rigidity => self.open_rigidity(&pattern(&text)),
            Ask::Texture | Ask::Normal => self.open_picture(ask, &pattern(&text)),
            Ask::Folder => self.folder = text,
            Ask::Poses => match self.open.as_ref().map(|open| open.model.files.clone()) {
                Some(files) if has_poses_beside(&files) => self.open_files(&Files { pose: paths, ..files }),
                _ => self.say(
                    "open an OBJ at rest first: scenes, asset folders and glTF files have their own poses"
                        .into(),
                ),
            },
        }
    }
}

const NO_MESH: &str = "open a mesh first";

/// The textures of a mesh's tiles. A path that leads to none of them is an error.
fn textures_of(model: &Model, path: &str) -> Result<Textures, String> {
    let read = |udim: u32| pictures::read(path, udim).map(|image| image.map(Arc::new));
    let all = model.pages.iter().map(|page| read(page.udim)).collect::<Result<Textures, _>>()?;
    if all.iter().all(Option::is_none) {
        return Err(format!("{path}: there is no such file for any tile"));
    }
    Ok(all)
}

/// True for a mesh at rest whose poses are other files.
fn has_poses_beside(files: &Files) -> bool {
    files.rest.as_ref().is_some_and(|rest| !is_gltf(rest))
}

fn ends(path: &Path, end: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(end))
}

/// True if an image has colours: then it is no rigidity map.
fn is_coloured(path: &Path) -> bool {
    let grey = |pixel: &image::Rgb<u8>| pixel.0[0] == pixel.0[1] && pixel.0[1] == pixel.0[2];
    image::open(path).is_ok_and(|image| !image.into_rgb8().pixels().all(grey))
}

/// The meaning of dropped paths; further poses and maps belong to the open OBJ.
fn files_of(paths: &[PathBuf], open: Option<&Files>) -> Result<Files, String> {
    if let [folder] = paths
        && folder.is_dir()
    {
        return Ok(Files { asset: Some(folder.clone()), ..Files::default() });
    }
    if let Some(path) = paths.iter().find(|path| is_gltf(path)) {
        return Ok(Files { rest: Some(path.clone()), ..Files::default() });
    }
    let mut files = open.filter(|files| has_poses_beside(files)).cloned().unwrap_or_default();
    let mut meshes = paths.iter().filter(|path| ends(path, "obj"));
    if files.rest.is_none() || paths.iter().filter(|path| ends(path, "obj")).count() > 1 {
        files = Files { rest: meshes.next().cloned(), ..Files::default() };
    }
    files.pose.extend(meshes.cloned());
    files.pose.extend(paths.iter().filter(|path| ends(path, "f32")).cloned());
    if let Some(map) = paths.iter().find(|path| ends(path, "png")) {
        files.rigidity = Some(pattern(&map.display().to_string()));
    }
    if files.rest.is_none() {
        return Err(format!(
            "{}: not an asset folder, an OBJ or glTF file, poses or a map",
            paths[0].display()
        ));
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dropped_files_are_rest_poses_and_maps() {
        let paths = |names: &[&str]| names.iter().map(PathBuf::from).collect::<Vec<_>>();
        let files = files_of(&paths(&["a/pose1.obj", "a/pose2.obj", "a/r.1002.png"]), None).expect("files");
        assert_eq!(files.rest, Some("a/pose1.obj".into()));
        assert_eq!(files.pose, paths(&["a/pose2.obj"]));
        assert_eq!(files.rigidity.as_deref(), Some("a/r.<UDIM>.png"));
        let more = files_of(&paths(&["b/more.f32"]), Some(&files)).expect("files");
        assert_eq!(more.pose, paths(&["a/pose2.obj", "b/more.f32"]));
        let gltf = files_of(&paths(&["a/skin.png", "a/walk.GLB"]), Some(&files)).expect("files");
        assert_eq!(gltf, Files { rest: Some("a/walk.GLB".into()), ..Files::default() });
        let next = files_of(&paths(&["a/rest.obj"]), Some(&gltf)).expect("files");
        assert_eq!(next.rest, Some("a/rest.obj".into()), "no pose of the glTF file");
        assert!(files_of(&paths(&["a/r.png"]), None).expect_err("no mesh").starts_with("a/r.png: "));
        let alone = files_of(&paths(&["a/rest.obj"]), None).expect("files");
        assert_eq!((alone.rest, alone.pose), (Some("a/rest.obj".into()), Vec::new()));
    }
}
