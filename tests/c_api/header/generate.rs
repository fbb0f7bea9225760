//! Writes the C header from `capi/src` into the template `capi/src/vrtm.h.in`: what `mirrored` writes,
//! and the rest by cbindgen. `@name@` in the template is the type, with its constants, or the function of that name;
//! or, if it is the name of a file, all of it that has no place of its own.

use std::collections::HashMap;
use std::path::Path;

use vrtm_capi::{CHOICES, MIRRORED};

use super::mirrored::{Words, initialiser};

const SECTIONS: [&str; 21] = [
    "status",
    "handle",
    "types",
    "allocator",
    "executor",
    "adapter",
    "device",
    "mesh",
    "asset",
    "tile",
    "prepare",
    "fetch",
    "dilation",
    "external",
    "map",
    "solve",
    "job",
    "report",
    "refine",
    "carrier",
    "defaults",
];

pub fn header(root: &Path) -> Result<String, String> {
    let config = cbindgen::Config::from_file(root.join("cbindgen.toml"))?;
    let template = root.join("capi/src/vrtm.h.in");
    let text =
        std::fs::read_to_string(&template).map_err(|error| format!("{}: {error}", template.display()))?;
    let mut header = text.clone();
    let mut place = |name: &str, text: &str| {
        let place = format!("@{name}@");
        if header.matches(&place).count() != 1 {
            return Err(format!("{}: {place} must stand there once", template.display()));
        }
        header = header.replace(&place, text);
        Ok(())
    };
    let words = Words::read(root)?;
    for choice in CHOICES {
        place(choice.name, &words.choice(choice)?)?;
    }
    for mirrored in MIRRORED {
        place(mirrored.name, &words.item(mirrored)?)?;
    }
    for name in SECTIONS {
        let source = root.join(format!("capi/src/{name}.rs"));
        let mut config = config.clone();
        config.export.include = public_types(&source)?;
        let bindings = cbindgen::Builder::new()
            .with_config(config)
            .with_src(&source)
            .generate()
            .map_err(|error| format!("{}: {error}", source.display()))?;
        let mut section = Vec::new();
        bindings.write(&mut section);
        let section = String::from_utf8(section).map_err(|error| error.to_string())?;
        let mut rest = Vec::new();
        for item in constants_below_their_type(&plain_types(&section), &source)? {
            match text.contains(&format!("@{}@", item_name(&item))) {
                true => place(item_name(&item), &item)?,
                false => rest.push(item),
            }
        }
        place(name, &rest.join("\n\n"))?;
    }
    for mirrored in MIRRORED {
        let (name, lines) = (mirrored.name, initialiser(mirrored, ""));
        if !lines.is_empty() {
            let with = format!("VRTM_DEFINE_INIT_WITH_({name},\n{})", lines.join("\n"));
            header = header.replace(&format!("VRTM_DEFINE_INIT_({name})"), &with);
        }
    }
    // A struct that is defined further down is declared by a line of the template.
    let declared: Vec<_> =
        text.lines().filter_map(|line| line.strip_prefix("struct ")?.strip_suffix(';')).collect();
    for name in declared {
        header = header.replace(&format!("const {name} *"), &format!("const struct {name} *"));
    }
    match header.split('@').nth(1) {
        None => Ok(header),
        Some(name) => Err(format!("{}: there is no {name}", template.display())),
    }
}

/// The name of a struct, a type or a function, which may be followed by constants.
fn item_name(item: &str) -> &str {
    let code = item.lines().position(|line| !line.starts_with("//")).map_or("", |first| {
        let comments: usize = item.lines().take(first).map(|line| line.len() + 1).sum();
        &item[comments..]
    });
    let head = match (code.strip_prefix("#define "), code.find("(*")) {
        (Some(name), _) => name.split(' ').next().unwrap_or(""),
        (None, Some(at)) if code.starts_with("typedef") && !code.starts_with("typedef struct") => {
            code[at + 2..].split(')').next().unwrap_or("")
        }
        _ => code.split(['(', ';', '{']).next().unwrap_or(""),
    };
    head.trim().rsplit([' ', '\n', '*']).next().unwrap_or("")
}

/// The items of a section. cbindgen writes all constants of a typedef'd type at the end: each belongs right below its
/// type.
fn constants_below_their_type(section: &str, source: &Path) -> Result<Vec<String>, String> {
    let text = std::fs::read_to_string(source).map_err(|error| format!("{}: {error}", source.display()))?;
    let types: HashMap<&str, &str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("pub const ")?.split_once(": "))
        .filter_map(|(name, rest)| Some((name, rest.split_once(' ')?.0)))
        .filter(|(_, of)| of.starts_with("vrtm_"))
        .collect();
    let type_of = |paragraph: &str| {
        let (_, line) = paragraph.rsplit_once('\n')?;
        types.get(line.strip_prefix("#define ")?.split(' ').next()?).copied()
    };
    let (constants, others): (Vec<_>, Vec<_>) =
        section.trim().split("\n\n").partition(|paragraph| type_of(paragraph).is_some());
    let mut items = Vec::new();
    for paragraph in others {
        let mut item = vec![paragraph];
        if let Some((_, name)) = paragraph.rsplit_once("typedef int32_t ") {
            let name = name.trim_end_matches(';');
            item.extend(constants.iter().filter(|constant| type_of(constant) == Some(name)));
        }
        items.push(item.join("\n\n"));
    }
    Ok(items)
}

/// cbindgen leaves out a type that no function of the same file uses, unless it is asked for.
fn public_types(source: &Path) -> Result<Vec<String>, String> {
    let text = std::fs::read_to_string(source).map_err(|error| format!("{}: {error}", source.display()))?;
    let names = text.lines().filter_map(|line| {
        let item = line.strip_prefix("pub struct ").or_else(|| line.strip_prefix("pub type "))?;
        item.split([' ', '{']).next().map(str::to_owned)
    });
    Ok(names.collect())
}

/// cbindgen writes `struct vrtm_x` for types of the same file and `vrtm_x` for others: always the latter.
fn plain_types(section: &str) -> String {
    let lines = section.lines().map(|line| match line.starts_with("typedef struct") {
        true => line.to_owned(),
        false => line.replace("struct vrtm_", "vrtm_"),
    });
    lines.collect::<Vec<_>>().join("\n")
}
