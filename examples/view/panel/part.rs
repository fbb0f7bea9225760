//! The mesh and the animation of a glTF file.

use eframe::egui::{Rect, Ui};

use super::settings::choice;
use super::side::section;
use crate::gltf::Choice;
use crate::model::Model;

/// Shows what the file holds, if it is one; returns the part to open in place of the one that is open.
pub fn show(ui: &mut Ui, model: &Model, mut noted: impl FnMut(&str, Rect)) -> Option<Choice> {
    let contents = model.contents.as_ref()?;
    let lists = [
        ("Mesh", "The mesh to look at.", &contents.meshes, contents.mesh),
        ("Animation", "The motion on the timeline.", &contents.animations, contents.animation.unwrap_or(0)),
    ];
    if lists.iter().all(|(.., all, _)| all.len() < 2) {
        return None;
    }
    let mut wish = model.choice.clone();
    section(ui, "glTF", true, |ui| {
        for ((id, about, all, now), wish) in lists.into_iter().zip([&mut wish.mesh, &mut wish.animation]) {
            let names: Vec<_> = all.iter().enumerate().map(|(k, name)| (k, name.as_str(), "")).collect();
            let mut chosen = now;
            if all.len() > 1 {
                choice(ui, (id, about), &mut chosen, &names, &mut noted);
            }
            if chosen != now {
                *wish = Some(all[chosen].clone());
            }
        }
    });
    (wish != model.choice).then_some(wish)
}
