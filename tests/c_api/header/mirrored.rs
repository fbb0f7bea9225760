//! Writes the structs and constants that mirror those of the Rust API: layouts and values from the lists in
//! `capi/src`, comments from the documentation of the Rust API, in the words of C. Of settings it writes the
//! initialisers, too, and docs/settings.md.

use std::collections::HashMap;
use std::path::Path;

use vrtm::{PbdSettings, Setting, SolveOptions, TileSettings};
use vrtm_capi::mirror::{Choice, Field, Struct};
use vrtm_capi::{CHOICES, MIRRORED};

/// Files of the Rust API with the mirrored documentation.
const SOURCES: [&str; 11] = [
    "crates/core/src/view.rs",
    "crates/core/src/image.rs",
    "crates/core/src/image/format.rs",
    "crates/core/src/log.rs",
    "crates/core/src/settings.rs",
    "crates/core/src/report.rs",
    "src/map/certificate/desc.rs",
    "src/refine.rs",
    "src/asset/carrier.rs",
    "crates/carry/src/bind.rs",
    "crates/carry/src/course.rs",
];

/// Choices that no setting has.
const NO_SETTINGS: [&str; 7] =
    ["Backend", "LogLevel", "LogCode", "PointState", "Scalar", "PixelFormat", "Origin"];

/// Names of Rust for items with another place in C.
const OTHER_NAMES: [(&str, &str); 6] = [
    ("DeviceInfo::reason", "vrtm_device_get_info"),
    ("DeviceSettings", "vrtm_device_desc"),
    ("MeshSource::max_layers", "vrtm_mesh_desc.max_layers"),
    ("Tile::fetch_dilation", "vrtm_tile_fetch_dilation"),
    ("Weld::uv_tolerance", "vrtm_mesh_desc.weld_uv_tolerance"),
    ("WeldBy::Position", "VRTM_WELD_POSITION"),
];

/// The documentation of each type ("Strain", ""), and of each field and variant ("Strain", "rms"), with its type.
pub struct Words(HashMap<(String, String), (String, String)>);

impl Words {
    pub fn read(root: &Path) -> Result<Words, String> {
        let mut found = HashMap::new();
        for source in SOURCES {
            let text =
                std::fs::read_to_string(root.join(source)).map_err(|error| format!("{source}: {error}"))?;
            let (mut of, mut comment) = ("", Vec::new());
            for line in text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with("#["))
            {
                if let Some(doc) = line.strip_prefix("///") {
                    comment.push(doc.trim());
                    continue;
                }
                let head = line.strip_prefix("pub struct ").or(line.strip_prefix("pub enum "));
                let item = head.or(line.strip_prefix("pub ")).unwrap_or(line);
                let end = item.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(item.len());
                let (name, rest) = item.split_at(end);
                if head.is_some() {
                    of = name;
                }
                if !of.is_empty() && !name.is_empty() {
                    let member = if head.is_some() { "" } else { name };
                    let kind =
                        rest.trim_start_matches(": ").split(" = ").next().unwrap_or("").trim_end_matches(',');
                    found.insert((of.to_owned(), member.to_owned()), (comment.join(" "), kind.to_owned()));
                }
                if line.starts_with('}') {
                    of = "";
                }
                comment.clear();
            }
        }
        Ok(Words(found))
    }

    fn about(&self, of: &str, member: &str) -> Result<&(String, String), String> {
        self.0
            .get(&(of.to_owned(), member.to_owned()))
            .filter(|(doc, _)| !doc.is_empty())
            .ok_or_else(|| format!("{of}::{member} has no documentation in {SOURCES:?}"))
    }

    /// A field's documentation, in the words of C: that of the Rust field at which its expression ends.
    fn of_field(&self, of: &Struct, field: &Field) -> Result<String, String> {
        if !field.about.is_empty() {
            return Ok(field.about.split_whitespace().collect::<Vec<_>>().join(" "));
        }
        let (mut at, mut doc) = (of.of.to_owned(), String::new());
        for step in field.from.split('.').skip(1).filter(|step| !step.ends_with("()")) {
            let (name, index) = step.split_once('[').unwrap_or((step, ""));
            let (about, kind) = self.about(&at, name)?;
            doc = match index {
                "" => about.clone(),
                "0]" => about.replace("in u and v", "in u"),
                _ => about.split_inclusive('.').next().unwrap_or("").replace("in u and v", "in v"),
            };
            at = kind.trim_start_matches("Option<").trim_end_matches('>').to_owned();
        }
        in_c(&doc, of.of)
    }

    /// A field's whole comment, with its limits, its default and its values.
    fn comment(&self, of: &Struct, field: &Field) -> Result<String, String> {
        let mut text = vec![self.of_field(of, field)?];
        if field.name.ends_with("_ms") {
            text.push("In milliseconds.".to_owned());
        }
        if let Some(setting) = setting(of, field) {
            let default = setting.default.parse::<f32>();
            match (setting.limits, default) {
                (Some(limits), Ok(default)) => {
                    let [least, most] = limits.map(number);
                    text.push(format!("{least} to {most}; default {}.", number(default)));
                }
                (None, Ok(default)) => text.push(format!("Default {}.", number(default))),
                _ => {}
            }
            if let Some(choice) = CHOICES.iter().find(|choice| choice.name == field.kind) {
                let names: Vec<_> = choice.values.iter().map(|(name, ..)| *name).collect();
                let (last, others) = names.split_last().unwrap();
                let others =
                    others.join(", ").replacen(names[0], &format!("{} (0, the default)", names[0]), 1);
                text.push(format!("{others} or {last}."));
            }
        }
        Ok(text.join(" "))
    }

    /// A struct with its comments.
    pub fn item(&self, of: &Struct) -> Result<String, String> {
        let &Struct { name, is_plain, .. } = of;
        let is_setting = of.of == "RefinementSettings" || settings(of.of).is_some();
        let head = in_c(&self.about(of.of, "")?.0, of.of)?;
        let start = match (is_plain, is_setting) {
            (true, _) => "A plain value that never grows.".to_owned(),
            (false, true) => format!("Start from {name}_init(), which sets the defaults."),
            (false, false) => format!("Start from {name}_init()."),
        };
        let mut lines = comment(&format!("{head} {start}"), "");
        lines.push(format!("typedef struct {name} {{"));
        if !is_plain {
            lines.extend(comment(&format!("sizeof({name}); set by {name}_init()."), "    "));
            lines.push("    uint32_t struct_size;".to_owned());
        }
        for field in of.fields {
            lines.extend(comment(&self.comment(of, field)?, "    "));
            lines.push(format!("    {};", declaration(field)));
        }
        lines.push(format!("}} {name};"));
        Ok(lines.join("\n"))
    }

    /// A type with its constants.
    pub fn choice(&self, of: &Choice) -> Result<String, String> {
        let mut items = vec![(self.about(of.of, "")?.0.clone(), format!("typedef int32_t {};", of.name))];
        for (name, value, variant) in of.values {
            let default = if *value == 0 { " The default." } else { "" };
            items.push((self.about(of.of, variant)?.0.clone() + default, format!("#define {name} {value}")));
        }
        let mut texts = Vec::new();
        for (doc, code) in items {
            texts.push(format!("{}\n{code}", comment(&in_c(&doc, of.of)?, "").join("\n")));
        }
        Ok(texts.join("\n\n"))
    }

    /// docs/settings.md.
    pub fn page(&self) -> Result<String, String> {
        let mut text = PAGE.to_owned();
        for (title, name) in [
            ("Settings of a tile", "vrtm_tile_settings"),
            ("Options of a solve", "vrtm_solve_options"),
            ("Settings of the paper's solver", "vrtm_pbd_settings"),
        ] {
            let of = MIRRORED.iter().find(|of| of.name == name).unwrap();
            text += &format!("\n## {title}\n\n`{name}`\n\n| name | purpose |\n|---|---|\n");
            for field in of.fields {
                text += &format!("| `{}` | {} |\n", field.name, self.comment(of, field)?);
            }
        }
        for choice in CHOICES.iter().filter(|choice| !NO_SETTINGS.contains(&choice.of)) {
            text += &format!("\n## {}\n\n", choice.name);
            text += &format!(
                "{}\n\n| value | meaning |\n|---|---|\n",
                in_c(&self.about(choice.of, "")?.0, choice.of)?
            );
            for (name, _, variant) in choice.values {
                text += &format!("| `{name}` | {} |\n", in_c(&self.about(choice.of, variant)?.0, choice.of)?);
            }
        }
        Ok(text)
    }
}

const PAGE: &str = "# Settings

This page lists all settings with their limits and defaults. They have the same names in the C header, C++, C# and
Python, where a value such as `VRTM_SEAMS_KEEP` is `\"keep\"`. Rust names three otherwise: `grid` holds `grid_width` and
`grid_height`, and `time_budget` is a `Duration` in place of `time_budget_ms`. `vrtm bake` takes a tile's settings as
options, such as `--smoothness-floor` and `--seams keep`. [Quality](quality.md) shows the effect of a change.

A test writes this page from the declarations in `crates/core/src/settings.rs`: do not edit it
([CONTRIBUTING.md](../CONTRIBUTING.md#a-setting)).
";

/// Settings of a struct's initialiser besides its size: the defaults that are not zero.
pub fn initialiser(of: &Struct, path: &str) -> Vec<String> {
    let mut lines = Vec::new();
    for field in of.fields {
        if let Some(inner) = MIRRORED.iter().find(|inner| inner.name == field.kind) {
            lines.extend(initialiser(inner, &format!("{path}{}.", field.name)));
        }
        let default = setting(of, field).map(|setting| setting.default.parse());
        if let Some(Ok(default)) = default
            && default != 0.0
        {
            let text = if field.kind == "f32" { format!("{default:?}f") } else { number(default) };
            lines.push(format!("    value.{path}{} = {text};", field.name));
        }
    }
    lines
}

fn settings(of: &str) -> Option<&'static [Setting]> {
    match of {
        "TileSettings" => Some(TileSettings::SETTINGS),
        "SolveOptions" => Some(SolveOptions::SETTINGS),
        "PbdSettings" => Some(PbdSettings::SETTINGS),
        _ => None,
    }
}

/// The setting that a field has in C.
fn setting(of: &Struct, field: &Field) -> Option<&'static Setting> {
    let (_, name) = field.from.split_once('.')?;
    settings(of.of)?.iter().find(|setting| setting.name == name)
}

fn number(number: f32) -> String {
    match number.abs() {
        size if size >= 1e5 || size > 0.0 && size < 1e-5 => format!("{number:e}"),
        _ => number.to_string(),
    }
}

/// A field as C declares it.
fn declaration(field: &Field) -> String {
    let array = field.kind.strip_prefix('[').and_then(|kind| kind.strip_suffix(']')?.split_once("; "));
    let (kind, name) = match array {
        Some((kind, length)) => (kind, format!("{}[{length}]", field.name)),
        None => (field.kind, field.name.to_owned()),
    };
    let (base, pointer) = match kind.split_once(' ') {
        Some(("*const", base)) => (base, "const "),
        Some(("*mut", base)) => (base, ""),
        _ => (kind, "-"),
    };
    let base = match base {
        "f32" => "float",
        "f64" => "double",
        "c_char" => "char",
        "u8" => "uint8_t",
        "u32" => "uint32_t",
        "u64" => "uint64_t",
        "usize" => "size_t",
        "c_void" => "void",
        other => other,
    };
    match pointer {
        "-" => format!("{base} {name}"),
        qualifier => format!("{qualifier}{base} *{name}"),
    }
}

/// Documentation of a Rust type in the words of C: names of C for links, numbers for flags and for `None`.
fn in_c(doc: &str, of: &str) -> Result<String, String> {
    let mut text = String::new();
    for (k, part) in doc.replace("[`", "`").replace("`]", "`").split('`').enumerate() {
        let code = k % 2 == 1;
        text += &match part {
            "None" if code => "0".to_owned(),
            name if code && (name.contains("::") || OTHER_NAMES.iter().any(|(rust, _)| *rust == name)) => {
                name_in_c(name, of).ok_or_else(|| format!("C has no {name}: {doc}"))?
            }
            name if code => format!("`{name}`"),
            words => words.replace("True", "1").replace("False", "0"),
        };
    }
    Ok(text)
}

fn name_in_c(link: &str, of: &str) -> Option<String> {
    let path: Vec<_> = link.split("::").collect();
    let link = path[path.len().saturating_sub(2)..].join("::");
    if let Some((_, name)) = OTHER_NAMES.iter().find(|(rust, _)| *rust == link) {
        return Some((*name).to_owned());
    }
    let (owner, member) = link.split_once("::")?;
    if let Some(choice) = CHOICES.iter().find(|choice| choice.of == owner) {
        return choice
            .values
            .iter()
            .find(|(.., variant)| *variant == member)
            .map(|(name, ..)| (*name).to_owned());
    }
    let owner = MIRRORED.iter().find(|mirrored| mirrored.of == owner)?;
    let field = owner
        .fields
        .iter()
        .find(|field| field.from.split_once('.').is_some_and(|(_, name)| name == member))?;
    Some(if owner.of == of { format!("`{}`", field.name) } else { format!("{}.{}", owner.name, field.name) })
}

/// A comment's lines.
fn comment(text: &str, indent: &str) -> Vec<String> {
    let mut lines = vec![format!("{indent}//")];
    for word in text.split_whitespace() {
        let line = lines.last_mut().unwrap();
        if line.len() + 1 + word.len() > 119 {
            lines.push(format!("{indent}// {word}"));
        } else {
            line.push(' ');
            line.push_str(word);
        }
    }
    lines
}
