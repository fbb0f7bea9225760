//! The shaders of docs/rendering, straight out of these pages: they parse, are valid, and read the redirection map
//! at its first level and the textures with explicit gradients.

use std::path::Path;

use naga::front::{glsl, wgsl};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{Expression, Module, SampleLevel, ShaderStage};

/// The one code block in that language on a page.
fn block_of(page: &str, language: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../docs/rendering/{page}.md"));
    let text = std::fs::read_to_string(path).expect(page);
    let fence = format!("\n```{language}\n");
    assert_eq!(text.matches(&fence).count(), 1, "one block in {language}");
    let start = text.find(&fence).unwrap() + fence.len();
    let end = start + text[start..].find("\n```").expect("the block's end") + 1;
    text[start..end].to_owned()
}

fn block(language: &str) -> String {
    block_of(language, language)
}

fn glsl(source: &str) -> Result<Module, String> {
    let options = glsl::Options::from(ShaderStage::Fragment);
    let module = glsl::Frontend::default().parse(&options, source).map_err(|e| e.emit_to_string(source))?;
    valid(module)
}

fn wgsl(source: &str) -> Result<Module, String> {
    valid(wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?)
}

fn valid(module: Module) -> Result<Module, String> {
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::default());
    validator.validate(&module).map_err(|e| format!("{e:?}"))?;
    Ok(module)
}

/// Kind of read of each texture, by name: the map at a level, the pictures with gradients. A plain sample would take
/// the level from derivatives of another UV than the one of the lookup.
fn reads(module: &Module) -> Vec<(String, &'static str)> {
    let mut reads = Vec::new();
    let functions = module.functions.iter().map(|(_, f)| f);
    for function in functions.chain(module.entry_points.iter().map(|e| &e.function)) {
        for (_, expression) in function.expressions.iter() {
            let Expression::ImageSample { image, level, .. } = expression else { continue };
            let Expression::GlobalVariable(image) = function.expressions[*image] else {
                panic!("a texture that is no global variable")
            };
            let how = match level {
                SampleLevel::Zero | SampleLevel::Exact(_) => "level",
                SampleLevel::Gradient { .. } => "gradient",
                SampleLevel::Auto | SampleLevel::Bias(_) => "automatic",
            };
            reads.push((module.global_variables[image].name.clone().unwrap_or_default(), how));
        }
    }
    reads.sort();
    reads
}

fn as_described(module: &Module) {
    let expected = [("albedo", "gradient"), ("bumps", "gradient"), ("redirection", "level")];
    assert_eq!(reads(module), expected.map(|(name, how)| (name.to_owned(), how)));
}

#[test]
fn the_documents_glsl_is_valid() {
    as_described(&glsl(&block("glsl")).unwrap_or_else(|e| panic!("{e}")));
}

#[test]
fn the_documents_glsl_of_layers_is_valid() {
    let module = glsl(&block_of("layers", "glsl")).unwrap_or_else(|e| panic!("{e}"));
    let expected = [("albedo", "gradient"), ("redirections", "level")];
    assert_eq!(reads(&module), expected.map(|(name, how)| (name.to_owned(), how)));
}

#[test]
fn the_documents_wgsl_is_valid() {
    as_described(&wgsl(&block("wgsl")).unwrap_or_else(|e| panic!("{e}")));
}

/// The checks above see a type that is wrong, and a lookup with levels of its own.
#[test]
fn wrong_shaders_are_noticed() {
    assert!(glsl(&block("glsl").replace("vec2 at = ", "vec3 at = ")).is_err());
    assert!(wgsl(&block("wgsl").replace("0.0).rg", "0.0).rgb")).is_err());
    let automatic = block("wgsl").replace(
        "textureSampleLevel(redirection, exact, turned(p.uv), 0.0)",
        "textureSample(redirection, exact, turned(p.uv))",
    );
    let module = wgsl(&automatic).unwrap_or_else(|e| panic!("{e}"));
    assert!(reads(&module).contains(&("redirection".to_owned(), "automatic")));
}
