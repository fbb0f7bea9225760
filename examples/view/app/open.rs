//! Opening a mesh.

use std::path::PathBuf;
use std::sync::Arc;

use eframe::egui::Ui;
use image::RgbaImage;
use serde_json::json;

use super::{App, Open};
use crate::brush::painter::Painter;
use crate::draw::camera::Orbit;
use crate::draw::paint;
use crate::draw::scene::Scene;
use crate::model::Model;
use crate::panel::figures::History;
use crate::solve::inbox::Edit;
use crate::source::Files;

impl App {
    /// Opens files. If that fails, what was open stays.
    pub(super) fn open_files(&mut self, files: &Files) {
        self.open_with(files, None);
    }

    /// Opens files, and the textures of the tiles.
    pub(super) fn open_with(&mut self, files: &Files, texture: Option<&str>) {
        let model = match Model::load(files) {
            Ok(model) => Arc::new(model),
            Err(failure) => return self.say(failure.0),
        };
        let textures = match textures_of(&model, texture) {
            Ok(textures) => textures,
            Err(message) => return self.say(message),
        };
        self.give_clip_up();
        let painter = Painter::new(&model);
        let scene = Scene::new(&self.gpu, &model, &painter.canvases, &textures);
        self.flow.edit += 1;
        self.worker.inbox.post(Edit::Open(model.clone(), painter.canvases.clone()));
        let udims: Vec<u32> = model.tiles.iter().map(|tile| tile.udim).collect();
        let facts = json!({ "name": model.name, "tiles": udims, "poses": model.frames.len() });
        self.trace.event("open", facts);
        self.shown = None;
        self.history = History::default();
        self.notice = None;
        self.screen.changed();
        self.stroke.moved();
        let mut line = model.timeline.clone();
        // What one sees first is what there is to see.
        line.go(line.keys[model.most_stretched()]);
        self.open = Some(Open {
            line,
            orbit: Orbit::of(&model.rest, model.centre, model.radius),
            first: self.flow.edit,
            painter,
            scene,
            model,
        });
    }

    /// Opens what was dropped on the window: a folder is an asset; OBJ files are rest and its poses, in the order of
    /// their names, and a PNG among them a rigidity map.
    pub(super) fn open_dropped(&mut self, ui: &Ui) {
        let dropped = ui.input(|i| i.raw.dropped_files.clone());
        let mut paths: Vec<PathBuf> = dropped.iter().map(|file| file.path().into()).collect();
        if paths.is_empty() {
            return;
        }
        paths.sort();
        match files_of(&paths, self.open.as_ref().map(|open| &open.model.files)) {
            Ok(files) => self.open_files(&files),
            Err(message) => self.say(message),
        }
    }
}

/// The textures of a mesh's tiles. A path that leads to none of them is an error.
fn textures_of(model: &Model, path: Option<&str>) -> Result<Vec<Option<RgbaImage>>, String> {
    let Some(path) = path else { return Ok(vec![None; model.tiles.len()]) };
    let all = model.tiles.iter().map(|tile| paint::read(path, tile.udim));
    let all: Vec<Option<RgbaImage>> = all.collect::<Result<_, _>>()?;
    if all.iter().all(Option::is_none) {
        return Err(format!("--texture: {path}: there is no such file for any tile"));
    }
    Ok(all)
}

/// What dropped paths mean; further poses and maps belong to the OBJ that is open.
fn files_of(paths: &[PathBuf], open: Option<&Files>) -> Result<Files, String> {
    if let [folder] = paths
        && folder.is_dir()
    {
        return Ok(Files { asset: Some(folder.clone()), ..Files::default() });
    }
    let ends = |path: &PathBuf, end: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(end));
    let mut files = open.filter(|files| files.rest.is_some()).cloned().unwrap_or_default();
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
        return Err(format!("{}: not an asset folder, an OBJ file, poses or a map", paths[0].display()));
    }
    Ok(files)
}

/// A path in which `<UDIM>` stands for the four digits of a tile's number, if its name has them.
fn pattern(path: &str) -> String {
    let parts: Vec<&str> = path.split('.').collect();
    let is_udim = |part: &&str| part.parse::<u32>().is_ok_and(|n| (1001..=9999).contains(&n));
    match parts.iter().rposition(is_udim) {
        Some(k) => parts
            .iter()
            .enumerate()
            .map(|(j, part)| if j == k { "<UDIM>" } else { part })
            .collect::<Vec<_>>()
            .join("."),
        None => path.into(),
    }
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
        assert!(files_of(&paths(&["a/r.png"]), None).expect_err("no mesh").starts_with("a/r.png: "));
        let alone = files_of(&paths(&["a/rest.obj"]), None).expect("files");
        assert_eq!((alone.rest, alone.pose), (Some("a/rest.obj".into()), Vec::new()));
        assert_eq!(pattern("maps.2020/r.png"), "maps.2020/r.png");
    }
}
