//! Running the bake program, and looking at what it wrote.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use exr::image::{AnyChannels, FlatSamples, Layer};
use exr::prelude::{ReadChannels as _, ReadLayers as _, read};
use serde_json::Value;

/// The bake program. Cargo builds examples before it runs tests, in a folder beside that of the test's executable.
pub fn bake(arguments: &[&str]) -> Output {
    without_remarks(command().args(arguments).output().expect("bake runs"))
}

/// An output without warnings of grids that are too coarse for their features: these keep tests short.
pub fn without_remarks(output: Output) -> Output {
    let is_remark = |line: &[u8]| line.windows(12).any(|words| words == b"are too few:");
    let lines = output.stderr.split_inclusive(|&byte| byte == b'\n');
    Output { stderr: lines.filter(|line| !is_remark(line)).flatten().copied().collect(), ..output }
}

/// The program, without arguments.
pub fn command() -> Command {
    let test = std::env::current_exe().expect("a path to this test");
    let profile = test.ancestors().nth(2).expect("target/<profile>/deps/<test>");
    let program = profile.join("examples").join(format!("bake{}", std::env::consts::EXE_SUFFIX));
    assert!(program.exists(), "{} is missing: cargo build --example bake", program.display());
    let mut command = Command::new(program);
    for variable in ["VRTM_DEVICE", "VRTM_THREADS", "VRTM_GPU_LIMITS"] {
        command.env_remove(variable);
    }
    // Without it, a layer of Mesa's Vulkan drivers prints a warning to stderr.
    command.env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR"));
    command
}

/// An empty folder for one test.
pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bake").join(name);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).expect("a folder");
    path
}

pub fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

pub fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

/// Runs a bake that must succeed without a warning; returns what it prints.
pub fn succeed(arguments: &[&str]) -> String {
    let (printed, warnings) = succeed_with_warnings(arguments);
    // There is no progress bar and no other output: stderr is not a terminal here.
    assert_eq!(warnings, "", "{arguments:?}");
    printed
}

/// The same, and what it prints to stderr.
pub fn succeed_with_warnings(arguments: &[&str]) -> (String, String) {
    let output = bake(arguments);
    let [printed, warnings] =
        [output.stdout, output.stderr].map(|text| String::from_utf8(text).expect("UTF-8"));
    assert!(output.status.success(), "{arguments:?}: {warnings}");
    (printed, warnings)
}

/// The one layer of an EXR file.
pub fn layer(path: &Path) -> Layer<AnyChannels<FlatSamples>> {
    read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()))
        .layer_data
}

/// Reads the size and the UVs of an EXR file, which must have the channels R, G and B of f32, and 0 in B.
pub fn read_exr(path: &Path) -> (usize, usize, Vec<[f32; 2]>) {
    let layer = layer(path);
    let channels = &layer.channel_data.list;
    let names: Vec<String> = channels.iter().map(|channel| channel.name.to_string()).collect();
    assert_eq!(names, ["B", "G", "R"], "{}", path.display());
    let [b, g, r] = [0, 1, 2].map(|k| match &channels[k].sample_data {
        FlatSamples::F32(values) => values,
        other => panic!("not f32: {other:?}"),
    });
    assert!(b.iter().all(|&x| x == 0.0));
    (layer.size.x(), layer.size.y(), r.iter().zip(g).map(|(&u, &v)| [u, v]).collect())
}

pub fn report(out: &Path) -> Value {
    let bytes = fs::read(out.join("report.json")).expect("a report");
    serde_json::from_slice(&bytes).expect("JSON")
}

/// Two quads side by side on two tiles, lifted in the pose, with a map each; UVs have indices of their own.
pub struct Files {
    pub folder: PathBuf,
}

pub const REST: &str = "o sheet\nv 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n\
    vt 0.1 0.1\nvt 0.9 0.1\nvt 0.9 0.9\nvt 0.1 0.9\nvt 1.1 0.1\nvt 1.9 0.1\nvt 1.9 0.9\nvt 1.1 0.9\n\
    f 1/1 2/2 5/3 4/4\nf 2/5 3/6 6/7 5/8\n";

impl Files {
    pub fn new(name: &str) -> Files {
        let files = Files { folder: folder(name) };
        files.write("rest.obj", REST.as_bytes());
        files.write("pose.obj", REST.replace("v 0 1 0", "v 0 1.4 0.2").as_bytes());
        files.write("poses.f32", &floats(&[0.5; 2 * 6 * 3]));
        let map = image::ImageBuffer::from_fn(32, 32, |x, y| {
            image::Luma([if (10..22).contains(&x) && (10..22).contains(&y) { u16::MAX } else { 0 }])
        });
        map.save(files.folder.join("r.1001.png")).expect("a map");
        // Nothing of the second tile is rigid.
        image::GrayImage::new(32, 32).save(files.folder.join("r.1002.png")).expect("a map");
        files
    }

    pub fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.folder.join(name), bytes).expect("a file");
    }

    pub fn path(&self, name: &str) -> String {
        text(&self.folder.join(name)).to_string()
    }

    /// The arguments for these files, without a film, and the output folder.
    pub fn arguments(&self, pose: &str, more: &[&str]) -> (Vec<String>, PathBuf) {
        let out = self.folder.join("out");
        let mut list =
            ["--rest", &self.path("rest.obj"), "--pose", &self.path(pose)].map(String::from).to_vec();
        list.extend(["--rigidity", &self.path("r.<UDIM>.png"), "--out", text(&out)].map(String::from));
        list.push("--no-film".into());
        list.extend(more.iter().map(|m| m.to_string()));
        (list, out)
    }
}

pub fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

pub fn borrow(arguments: &[String]) -> Vec<&str> {
    arguments.iter().map(String::as_str).collect()
}

/// Expects exit code 2, one line that names the culprit, and no file in the output folder.
pub fn refuse(arguments: &[String], out: &Path, culprit: &str, reason: &str) {
    let output = bake(&borrow(arguments));
    let line = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
    assert_eq!(line.lines().count(), 1, "one line: {line}");
    assert!(line.contains(culprit), "'{culprit}' in: {line}");
    assert!(line.contains(reason), "'{reason}' in: {line}");
    assert_eq!(names(out), Vec::<String>::new(), "{line}");
    assert!(output.stdout.is_empty());
}
