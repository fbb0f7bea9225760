//! The bake example as its users run it: the files that it writes, their contents, and the refusal of bad input.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use exr::prelude::{ReadChannels as _, ReadLayers as _, read};
use serde_json::Value;

/// The bake program. Cargo builds examples before it runs tests, in a folder beside that of the test's executable.
fn bake(arguments: &[&str]) -> Output {
    let test = std::env::current_exe().expect("a path to this test");
    let profile = test.ancestors().nth(2).expect("target/<profile>/deps/<test>");
    let program = profile.join("examples").join(format!("bake{}", std::env::consts::EXE_SUFFIX));
    assert!(program.exists(), "{} is missing: cargo build --example bake", program.display());
    Command::new(program)
        .args(arguments)
        .env_remove("VRTM_DEVICE")
        .env_remove("VRTM_THREADS")
        .env_remove("VRTM_GPU_LIMITS")
        // Without it, a layer of Mesa's Vulkan drivers prints a warning to stderr.
        .env("XDG_RUNTIME_DIR", env!("CARGO_TARGET_TMPDIR"))
        .output()
        .expect("bake runs")
}

/// An empty folder for one test.
fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join("bake").join(name);
    let _ = fs::remove_dir_all(&path);
    fs::create_dir_all(&path).expect("a folder");
    path
}

fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

fn succeed(arguments: &[&str]) -> String {
    let output = bake(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    // There is no progress bar and no other output: stderr is not a terminal here.
    assert_eq!(errors, "", "{arguments:?}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Reads the size and the texels of an EXR file, which must have the channels R and G and no others.
fn read_exr(path: &Path) -> (usize, usize, Vec<[f32; 2]>) {
    let image = read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_file(path)
        .unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let layer = image.layer_data;
    let channels = &layer.channel_data.list;
    let titles: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
    assert_eq!(titles, ["G", "R"], "EXR sorts channels by name");
    let values: Vec<Vec<f32>> = channels
        .iter()
        .map(|c| match &c.sample_data {
            exr::image::FlatSamples::F32(values) => values.clone(),
            other => panic!("not f32: {other:?}"),
        })
        .collect();
    let texels = values[1].iter().zip(&values[0]).map(|(&u, &v)| [u, v]).collect();
    (layer.size.x(), layer.size.y(), texels)
}

fn report(out: &Path) -> Value {
    let bytes = fs::read(out.join("report.json")).expect("a report");
    serde_json::from_slice(&bytes).expect("JSON")
}

#[test]
fn the_built_in_scene_gives_exactly_its_files() {
    let out = folder("mug");
    let table = succeed(&["--size", "64", "--frames", "2,4", "--out", text(&out)]);
    let expected = [
        "redirect.0002.1001.exr",
        "redirect.0004.1001.exr",
        "report.json",
        "sheet.0002.png",
        "sheet.0004.png",
        "warp.0002.1001.exr",
        "warp.0004.1001.exr",
    ];
    assert_eq!(names(&out), expected);
    assert!(table.contains("1001") && table.contains("->"), "{table}");

    let (width, height, redirect) = read_exr(&out.join("redirect.0004.1001.exr"));
    assert_eq!((width, height), (64, 64));
    let (columns, rows, warp) = read_exr(&out.join("warp.0004.1001.exr"));
    assert_eq!((columns, rows), (65, 65));
    let mut largest = 0.0f32;
    for y in 0..height {
        for x in 0..width {
            let centre = [(x as f32 + 0.5) / 64.0, 1.0 - (y as f32 + 0.5) / 64.0];
            let uv = redirect[y * width + x];
            let moved = (uv[0] - centre[0]).abs().max((uv[1] - centre[1]).abs());
            // All nodes between the charts of the side (v >= 0.55) and of the handle (v <= 0.40) are fixed; the two
            // rows of cells beside a chart belong to it. One rounding of f32 is allowed.
            if (0.44..0.51).contains(&centre[1]) {
                assert!(moved <= 1e-6, "texel ({x}, {y}) moved by {moved}");
            }
            largest = largest.max(moved);
        }
    }
    assert!(largest > 0.25 / 64.0, "a jug's studs are somewhere else than a mug's: {largest}");
    // Nodes lie at the corners of cells, so that the image reaches from corner to corner of the tile; v points up, and
    // the first row is at the top.
    assert_eq!(warp[0], [0.0, 1.0]);
    assert_eq!(warp[64], [1.0, 1.0]);
    assert_eq!(warp[65 * 64], [0.0, 0.0]);

    let sheet = image::open(out.join("sheet.0004.png")).expect("a picture");
    assert!(sheet.width() > 1500 && sheet.height() > 700);
}

#[test]
fn the_report_has_every_figure() {
    let out = folder("report");
    succeed(&["--scene", "arm", "--size", "64", "--frames", "2-3", "--out", text(&out)]);
    let report = report(&out);
    assert_eq!(report["program"]["version"], env!("CARGO_PKG_VERSION"));
    assert_eq!(report["settings"]["quality"], "normal");
    assert_eq!(report["asset"]["tiles"], 2);
    assert_eq!(report["tiles"][1]["udim"], 1002);
    let frames = report["frames"].as_array().expect("frames");
    let numbers: Vec<_> = frames.iter().map(|f| f["frame"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [2, 3]);
    for frame in frames {
        for tile in frame["tiles"].as_array().expect("tiles") {
            for key in [
                "energy_before",
                "energy",
                "min_jacobian",
                "folds",
                "sweeps",
                "corrections",
                "nodes_active",
                "bytes",
            ] {
                assert!(tile[key].is_number(), "{key}: {}", tile[key]);
            }
            for key in ["surface", "pyramid", "prolong", "relax", "correct", "certify", "invert", "total"] {
                assert!(tile["ms"][key].is_number(), "ms.{key}");
            }
            for side in ["before", "after"] {
                for key in ["rms", "median", "p95", "p99", "max", "border_rms", "interior_rms", "free_rms"] {
                    assert!(tile["strain"][side][key].is_number(), "strain.{side}.{key}");
                }
            }
            assert!(tile["strain"]["harm"].is_number() && tile["strain"]["help"].is_number());
            assert_eq!(tile["folds"], 0);
            let rms = |side: &str| tile["strain"][side]["rms"].as_f64().unwrap();
            assert!(rms("after") < rms("before"), "tile {}", tile["udim"]);
        }
    }
}

/// The assets are optional; if present, they lie beside the checkout.
#[test]
fn real_assets_bake() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/assets");
    if !assets.is_dir() {
        assert!(std::env::var_os("VRTM_REQUIRE_ASSETS").is_none(), "no {}", assets.display());
        println!("skipped: no {}", assets.display());
        return;
    }
    for name in names(&assets) {
        let asset = assets.join(&name);
        if !asset.join("asset.json").is_file() {
            continue;
        }
        let out = folder(&format!("asset_{name}"));
        succeed(&["--asset", text(&asset), "--size", "128", "--frames", "1", "--out", text(&out)]);
        let report = report(&out);
        assert_eq!(report["scene"]["name"], name);
        let tiles = report["frames"][0]["tiles"].as_array().expect("tiles");
        assert_eq!(names(&out).len(), 2 * tiles.len() + 2, "{name}");
        for tile in tiles {
            let strain = &tile["strain"];
            println!("{name} {}: {} -> {}", tile["udim"], strain["before"]["rms"], strain["after"]["rms"]);
            assert_eq!(tile["folds"], 0, "{name}");
            assert!(tile["min_jacobian"].as_f64().is_some_and(|j| j > 0.0), "{name}");
        }
    }
}

/// Two quads side by side on two tiles, lifted in the pose; UVs have indices of their own.
struct Files {
    folder: PathBuf,
}

const REST: &str = "o sheet\nv 0 0 0\nv 1 0 0\nv 2 0 0\nv 0 1 0\nv 1 1 0\nv 2 1 0\n\
    vt 0.1 0.1\nvt 0.9 0.1\nvt 0.9 0.9\nvt 0.1 0.9\nvt 1.1 0.1\nvt 1.9 0.1\nvt 1.9 0.9\nvt 1.1 0.9\n\
    f 1/1 2/2 5/3 4/4\nf 2/5 3/6 6/7 5/8\n";

impl Files {
    fn new(name: &str) -> Files {
        let files = Files { folder: folder(name) };
        files.write("rest.obj", REST.as_bytes());
        files.write("pose.obj", REST.replace("v 0 1 0", "v 0 1.4 0.2").as_bytes());
        files.write("poses.f32", &floats(&[0.5; 2 * 6 * 3]));
        let map = image::ImageBuffer::from_fn(32, 32, |x, y| {
            image::Luma([if (10..22).contains(&x) && (10..22).contains(&y) { u16::MAX } else { 0 }])
        });
        map.save(files.folder.join("r.1001.png")).expect("a map");
        image::GrayImage::from_pixel(32, 32, image::Luma([255]))
            .save(files.folder.join("m.1001.png"))
            .expect("a mask");
        files
    }

    fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.folder.join(name), bytes).expect("a file");
    }

    fn path(&self, name: &str) -> String {
        text(&self.folder.join(name)).to_string()
    }

    /// The arguments for these files, and the output folder.
    fn arguments(&self, pose: &str, more: &[&str]) -> (Vec<String>, PathBuf) {
        let out = self.folder.join("out");
        let mut list =
            ["--rest", &self.path("rest.obj"), "--pose", &self.path(pose)].map(String::from).to_vec();
        list.extend(["--rigidity", &self.path("r.<UDIM>.png"), "--out", text(&out)].map(String::from));
        list.extend(more.iter().map(|m| m.to_string()));
        (list, out)
    }
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn borrow(arguments: &[String]) -> Vec<&str> {
    arguments.iter().map(String::as_str).collect()
}

#[test]
fn a_users_own_files_bake_and_a_tile_without_a_map_is_the_identity() {
    let files = Files::new("files");
    let mask = files.path("m.<UDIM>.png");
    let (arguments, out) = files.arguments("pose.obj", &["--mask", &mask]);
    succeed(&borrow(&arguments));
    let expected = [
        "redirect.0001.1001.exr",
        "redirect.0001.1002.exr",
        "report.json",
        "sheet.0001.png",
        "warp.0001.1001.exr",
        "warp.0001.1002.exr",
    ];
    assert_eq!(names(&out), expected);
    let (width, height, texels) = read_exr(&out.join("redirect.0001.1002.exr"));
    // A tile without a map has the size of the other tile's map.
    assert_eq!((width, height), (32, 32));
    for (i, uv) in texels.iter().enumerate() {
        let centre = [(i % 32) as f32 + 0.5, 31.5 - (i / 32) as f32].map(|x| x / 32.0);
        assert!((uv[0] - centre[0]).abs() <= 1e-6 && (uv[1] - centre[1]).abs() <= 1e-6, "texel {i}: {uv:?}");
    }
    assert_eq!(report(&out)["tiles"][1]["rigidity"], Value::Null);
}

#[test]
fn poses_of_several_files_are_frames_in_their_order() {
    let files = Files::new("poses");
    let pose = files.path("pose.obj");
    let (arguments, out) = files.arguments("poses.f32", &["--pose", &pose, "--frames", "3"]);
    succeed(&borrow(&arguments));
    assert!(names(&out).contains(&"sheet.0003.png".to_string()), "{:?}", names(&out));
    assert_eq!(report(&out)["frames"][0]["note"], "pose");
}

/// Expects exit code 2, one line that names the culprit, and no file in the output folder.
fn refuse(arguments: &[String], out: &Path, culprit: &str, reason: &str) {
    let output = bake(&borrow(arguments));
    let line = String::from_utf8(output.stderr).expect("UTF-8");
    assert_eq!(output.status.code(), Some(2), "{arguments:?}: {line}");
    assert_eq!(line.lines().count(), 1, "one line: {line}");
    assert!(line.contains(culprit), "'{culprit}' in: {line}");
    assert!(line.contains(reason), "'{reason}' in: {line}");
    assert_eq!(names(out), Vec::<String>::new(), "{line}");
    assert!(output.stdout.is_empty());
}

#[test]
fn bad_files_are_refused() {
    let files = Files::new("bad_files");
    let check = |pose: &str, culprit: &str, reason: &str| {
        let (arguments, out) = files.arguments(pose, &[]);
        refuse(&arguments, &out, culprit, reason);
    };
    check("none.obj", "none.obj", "");
    files.write("short.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n");
    check("short.obj", "short.obj", "3 vertices, but the rest mesh has 6");
    files.write("nan.obj", REST.replace("v 2 0 0", "v 2 nan 0").as_bytes());
    check("nan.obj", "nan.obj", "not finite");
    files.write("broken.obj", REST.replace("v 2 0 0", "v 2 zero 0").as_bytes());
    check("broken.obj", "broken.obj", "line 4");
    files.write("cut.f32", &floats(&[0.0; 6 * 3])[..70]);
    check("cut.f32", "cut.f32", "70 bytes");
    files.write("empty.f32", b"");
    check("empty.f32", "empty.f32", "0 bytes");
    files.write("inf.f32", &floats(&[f32::INFINITY; 6 * 3]));
    check("inf.f32", "inf.f32", "not finite");
    let path = files.path("r.1001.png");
    let png = fs::read(&path).expect("the map");
    files.write("r.1001.png", &png[..png.len() / 2]);
    check("pose.obj", "r.1001.png", "");
    files.write("r.1001.png", b"not a picture");
    check("pose.obj", "r.1001.png", "");
    fs::remove_file(path).expect("the map");
    check("pose.obj", "r.<UDIM>.png", "no such file");
}

#[test]
fn bad_meshes_are_refused() {
    let files = Files::new("bad_meshes");
    for (text, reason) in [
        (REST.replace("v 0 1 0", "v 0 inf 0"), "not finite"),
        (REST.replace("vt 0.9 0.9", "vt nan 0.9"), "not finite"),
        (REST.replace("6/7", "60/7"), "face 2"),
        (REST.replace("1/1", "1"), "no texture coordinates"),
        ("v 0 0 0\n".to_string(), "no faces"),
        ("hello\n".to_string(), "no vertices"),
    ] {
        files.write("rest.obj", text.as_bytes());
        let (arguments, out) = files.arguments("pose.obj", &[]);
        refuse(&arguments, &out, "rest.obj", reason);
    }
}

#[test]
fn bad_assets_are_refused() {
    let base = folder("bad_asset");
    let out = base.join("out");
    let arguments = ["--asset", text(&base), "--out", text(&out)].map(String::from);
    refuse(&arguments, &out, "asset.json", "");
    fs::write(base.join("asset.json"), "{ \"name\": ").expect("a file");
    refuse(&arguments, &out, "asset.json", "EOF");
    fs::write(base.join("asset.json"), "{ \"rigidity\": { \"1001\": 7 }, \"frames\": 1 }").expect("a file");
    fs::write(base.join("rest.obj"), REST).expect("a file");
    fs::write(base.join("frames.f32"), floats(&[0.0; 6 * 3])).expect("a file");
    refuse(&arguments, &out, "asset.json", "rigidity");
    fs::write(base.join("asset.json"), "{ \"frames\": 2 }").expect("a file");
    refuse(&arguments, &out, "frames.f32", "1 frames, but asset.json says 2");
}

#[test]
fn bad_arguments_are_refused() {
    let no_adapter_99 =
        if vrtm::adapters().is_empty() { "there is no GPU" } else { "adapter: 99 is out of range" };
    let out = folder("bad_arguments").join("out");
    for (arguments, culprit, reason) in [
        (&["--quality", "best"][..], "--quality", "best"),
        (&["--solver", "magic"], "--solver", "magic"),
        (&["--solver", "pbd", "--iterations", "1025"], "--iterations", "1024"),
        (&["--frames", "0"], "--frames", "start at 1"),
        (&["--frames", "3-1"], "--frames", "backwards"),
        (&["--frames", "99"], "--frames", "5 frames"),
        (&["--size", "0"], "--size", "0"),
        (&["--size", "100000"], "--size", "16384"),
        (&["--scene", "teapot"], "teapot", "mug_to_jug"),
        (&["--threads", "many"], "--threads", "many"),
        (&["--threads", "5000"], "threads", "5000"),
        (&["--device", "tpu"], "--device", "tpu"),
        (&["--device", "gpu", "--adapter", "99"], "--device", no_adapter_99),
        (&["--adapter", "first"], "--adapter", "first"),
        (&["--view", "30"], "--view", "two angles"),
        (&["--rest", "a.obj"], "--pose", "required"),
        (&["--loud"], "--loud", "unexpected"),
    ] {
        let mut list: Vec<String> = arguments.iter().map(|a| a.to_string()).collect();
        list.extend(["--out".to_string(), text(&out).to_string()]);
        refuse(&list, &out, culprit, reason);
    }
}

#[test]
fn an_output_folder_that_cannot_be_made_is_refused() {
    let base = folder("bad_out");
    let file = base.join("file");
    fs::write(&file, "").expect("a file");
    let out = file.join("out");
    let arguments = ["--size", "16", "--frames", "1", "--out", text(&out)].map(String::from);
    refuse(&arguments, &out, "out", "");
    assert_eq!(names(&base), ["file"]);
}

#[test]
fn help_tells_the_options() {
    let help = succeed(&["--help"]);
    for option in ["--asset", "--rest", "--pose", "--rigidity", "--mask", "--frames", "--out", "--size"] {
        assert!(help.contains(option), "{option}");
    }
    for option in [
        "--quality",
        "--solver",
        "--iterations",
        "--warm",
        "--temporal-weight",
        "--device",
        "--adapter",
        "--threads",
        "draft",
        "high",
        "redirect.####.<UDIM>.exr",
    ] {
        assert!(help.contains(option), "{option}");
    }
}
