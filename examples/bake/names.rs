//! Names of the files that are written: a pattern with placeholders.

use std::path::{Component, Path};

use crate::failure::{Failure, Result};

/// A path below the output folder, in which `<kind>`, `<frame>` and `<UDIM>` stand for what a file holds.
#[derive(Clone, Debug)]
pub struct Pattern(String);

/// What is used without `--name`: renderers and painting programs want the tile's number last.
pub const DEFAULT: &str = "<kind>.<frame>.<UDIM>.exr";

impl Pattern {
    /// Reads a pattern. Whether it keeps all names apart depends on how many kinds, frames and tiles are written.
    pub fn new(text: &str, kinds: usize, frames: usize, tiles: usize) -> Result<Pattern> {
        let bad = |reason: String| Err(Failure::named(&format!("--name {text}"), reason));
        let path = Path::new(text);
        if !path.components().all(|part| matches!(part, Component::Normal(_))) || text.contains('\\') {
            return bad(
                "it must stay inside of the output folder: no '..', no '\\', no '/' at its start".into()
            );
        }
        let file = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        if text.ends_with('/') || !file.ends_with(".exr") || file == ".exr" {
            return bad("it must end in .exr, with a name before that".into());
        }
        let mut rest = text;
        while let Some(start) = rest.find('<') {
            let end = rest[start..].find('>').map_or(rest.len(), |length| start + length + 1);
            let placeholder = &rest[start..end];
            if !["<kind>", "<frame>", "<UDIM>"].contains(&placeholder) {
                return bad(format!("'{placeholder}' is none of <kind>, <frame> and <UDIM>"));
            }
            rest = &rest[end..];
        }
        for (placeholder, count, things) in
            [("<kind>", kinds, "kinds"), ("<frame>", frames, "frames"), ("<UDIM>", tiles, "tiles")]
        {
            if count > 1 && !text.contains(placeholder) {
                return bad(format!("{count} {things} are written: {placeholder} must keep them apart"));
            }
        }
        Ok(Pattern(text.into()))
    }

    /// The name of an EXR file.
    pub fn name(&self, kind: &str, frame: usize, udim: u32) -> String {
        let frame = format!("{frame:04}");
        self.0.replace("<kind>", kind).replace("<frame>", &frame).replace("<UDIM>", &udim.to_string())
    }
}

/// The name of a frame's sheet.
pub fn sheet(frame: usize) -> String {
    format!("sheet.{frame:04}.png")
}

/// The name of the report.
pub const REPORT: &str = "report.json";
