//! A user's own files: maps in every format, values per vertex, masks.

use std::fs::{self, File};
use std::path::Path;

use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image, Layer};
use exr::meta::header::LayerAttributes;
use exr::prelude::{IntegerBounds, SmallVec, Vec2, WritableImage as _, f16};
use image::{ImageBuffer, Luma};
use serde_json::Value;
use tiff::encoder::{TiffEncoder, colortype::Gray32Float};

use crate::common::{Files, REST, borrow, names, read_exr, refuse, report, succeed, succeed_with_warnings};

#[test]
fn a_users_own_files_bake_and_a_tile_without_a_map_is_the_identity() {
    let files = Files::new("files");
    fs::remove_file(files.path("r.1002.png")).unwrap();
    let mask = files.path("m.<UDIM>.png");
    let (arguments, out) = files.arguments("pose.obj", &["--mask", &mask]);
    let (_, warnings) = succeed_with_warnings(&borrow(&arguments));
    let [line] = warnings.lines().collect::<Vec<_>>()[..] else { panic!("one line: {warnings}") };
    assert!(line.contains("warning") && line.contains("r.<UDIM>.png") && line.ends_with(": 1002"), "{line}");
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

/// Texels on a side of the pictures.
const SIDE: u32 = 32;

/// Black with a white square, which starts and ends where a JPEG's blocks do, so that even that holds it exactly.
fn square(x: u32, y: u32) -> f32 {
    f32::from((8..24).contains(&x) && (8..16).contains(&y))
}

/// A soft spot, in 65536 steps.
fn spot(x: u32, y: u32) -> f32 {
    let [dx, dy] = [x, y].map(|k| (k as f32 - 15.0) / 12.0);
    f32::from((65535.0 * (1.0 - (dx * dx + dy * dy).min(1.0))) as u16) / 65535.0
}

/// All texels of a picture, row by row.
fn texels(picture: fn(u32, u32) -> f32) -> Vec<f32> {
    (0..SIDE * SIDE).map(|k| picture(k % SIDE, k / SIDE)).collect()
}

fn write_exr(path: &Path, channels: &[(&str, FlatSamples)]) {
    let list: SmallVec<[_; 4]> =
        channels.iter().map(|(name, samples)| AnyChannel::new(*name, samples.clone())).collect();
    let layer = Layer::new(
        (SIDE as usize, SIDE as usize),
        LayerAttributes::default(),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(list),
    );
    Image::from_layer(layer).write().to_file(path).expect("an EXR");
}

/// Writes a picture as one file of each kind; returns their names.
fn in_every_format(folder: &Path, picture: fn(u32, u32) -> f32) -> Vec<&'static str> {
    let values = texels(picture);
    let deep = |x, y| Luma([(picture(x, y) * 65535.0).round() as u16]);
    let shallow = |x, y| Luma([(picture(x, y) * 255.0).round() as u8]);
    let path = |name: &str| folder.join(name);
    for name in ["8.1001.png", "8.1001.tif", "8.1001.jpg"] {
        let image = ImageBuffer::from_fn(SIDE, SIDE, shallow);
        match name {
            "8.1001.jpg" => {
                let file = File::create(path(name)).expect("a file");
                let encoder = image::codecs::jpeg::JpegEncoder::new_with_quality(file, 100);
                image.write_with_encoder(encoder).expect("a JPEG");
            }
            _ => image.save(path(name)).expect("a picture"),
        }
    }
    for name in ["16.1001.png", "16.1001.tif"] {
        ImageBuffer::from_fn(SIDE, SIDE, deep).save(path(name)).expect("a picture");
    }
    // A colour image of 16 bits.
    let colour = |x, y| image::Rgb([deep(x, y).0[0]; 3]);
    ImageBuffer::from_fn(SIDE, SIDE, colour).save(path("colour.1001.png")).expect("a picture");
    let file = File::create(path("float.1001.tif")).expect("a file");
    TiffEncoder::new(file)
        .and_then(|mut tiff| tiff.write_image::<Gray32Float>(SIDE, SIDE, &values))
        .expect("a TIFF");
    let floats = FlatSamples::F32(values.clone());
    write_exr(&path("one.1001.exr"), &[("mask of studs", floats.clone())]);
    write_exr(&path("rgb.1001.exr"), &["R", "G", "B"].map(|name| (name, floats.clone())));
    let other = FlatSamples::F32(vec![0.25; values.len()]);
    write_exr(&path("r.1001.exr"), &[("studs.R", floats), ("studs.A", other)]);
    let halves = FlatSamples::F16(values.iter().map(|&x| f16::from_f32(x)).collect());
    write_exr(&path("half.1001.exr"), &[("Y", halves)]);
    vec![
        "8.1001.png",
        "8.1001.tif",
        "8.1001.jpg",
        "16.1001.png",
        "16.1001.tif",
        "colour.1001.png",
        "float.1001.tif",
        "one.1001.exr",
        "rgb.1001.exr",
        "r.1001.exr",
        "half.1001.exr",
    ]
}

/// The bits of the first tile's map, baked with a map as the rigidity or as the mask.
fn baked(files: &Files, option: &str, map: &str, more: &[&str]) -> Vec<[u32; 2]> {
    let out = files.folder.join("baked");
    let _ = fs::remove_dir_all(&out);
    let mut arguments: Vec<String> =
        ["--rest", &files.path("rest.obj"), "--pose", &files.path("pose.obj")].map(String::from).to_vec();
    let fixed = ["--size", "32", "--frames", "1", "--no-sheet", "--out", out.to_str().unwrap()];
    arguments.extend(fixed.map(String::from));
    arguments.extend([option.to_string(), map.to_string()]);
    arguments.extend(more.iter().map(|word| word.to_string()));
    // Most maps are those of the first tile alone, which is warned of.
    succeed_with_warnings(&borrow(&arguments));
    read_exr(&out.join("redirect.0001.1001.exr")).2.iter().map(|uv| uv.map(f32::to_bits)).collect()
}

/// The longest way that a texel of a map was moved, in texels.
fn longest(bits: &[[u32; 2]]) -> f32 {
    let way = |(k, uv): (usize, &[u32; 2])| {
        let at = [(k as u32 % SIDE) as f32 + 0.5, SIDE as f32 - (k as u32 / SIDE) as f32 - 0.5];
        let [u, v] = uv.map(|bits| f32::from_bits(bits) * SIDE as f32);
        (u - at[0]).abs().max((v - at[1]).abs())
    };
    bits.iter().enumerate().map(way).fold(0.0, f32::max)
}

#[test]
fn a_picture_is_the_same_in_every_format() {
    let files = Files::new("formats");
    let all = in_every_format(&files.folder, square);
    let pattern = |name: &str| files.path(&name.replace("1001", "<UDIM>"));
    let expected = baked(&files, "--rigidity", &pattern("8.1001.png"), &[]);
    assert!(longest(&expected) > 0.1, "{}", longest(&expected));
    for name in &all[1..] {
        assert!(baked(&files, "--rigidity", &pattern(name), &[]) == expected, "{name}");
    }
    // A mask's black and white hold and free the same nodes.
    let rigid = files.path("r.<UDIM>.png");
    let masked = |name: &str| baked(&files, "--mask", &pattern(name), &["--rigidity", &rigid]);
    let expected = masked(all[0]);
    assert!(expected != baked(&files, "--rigidity", &rigid, &[]), "the mask shows");
    for name in &all[1..] {
        assert!(masked(name) == expected, "{name}");
    }
}

#[test]
fn sixteen_bits_are_kept() {
    let files = Files::new("sixteen_bits");
    in_every_format(&files.folder, spot);
    let of = |name: &str| baked(&files, "--rigidity", &files.path(name), &[]);
    // A path without <UDIM> serves a mesh with one tile.
    files.write("rest.obj", one_tile(REST).as_bytes());
    files.write("pose.obj", one_tile(REST).replace("v 0 1 0", "v 0 1.4 0.2").as_bytes());
    let expected = of("16.1001.png");
    for name in ["16.1001.tif", "colour.1001.png", "float.1001.tif", "one.1001.exr", "rgb.1001.exr"] {
        assert!(of(name) == expected, "{name}");
    }
    for name in ["8.1001.png", "8.1001.tif", "half.1001.exr"] {
        assert!(of(name) != expected, "{name}");
    }
    assert!(of("8.1001.png") == of("8.1001.tif"));
}

/// The first face alone.
fn one_tile(obj: &str) -> String {
    obj.replace("f 2/5 3/6 6/7 5/8\n", "")
}

#[test]
fn a_cropped_exr_is_placed_in_its_display_window() {
    let files = Files::new("cropped");
    let values = texels(square);
    write_exr(&files.folder.join("whole.1001.exr"), &[("Y", FlatSamples::F32(values.clone()))]);
    // The rows and columns from 4 to 27.
    let inner = (4..28).flat_map(|y| values[y * 32 + 4..y * 32 + 28].to_vec()).collect();
    let channels = AnyChannels::sort(SmallVec::from_vec(vec![AnyChannel::new("Y", FlatSamples::F32(inner))]));
    let attributes = LayerAttributes { layer_position: Vec2(4, 4), ..LayerAttributes::default() };
    let layer = Layer::new((24, 24), attributes, Encoding::SMALL_LOSSLESS, channels);
    let mut image = Image::from_layer(layer);
    image.attributes.display_window = IntegerBounds::new((0, 0), (32, 32));
    image.write().to_file(files.folder.join("cropped.1001.exr")).expect("an EXR");
    let of = |name: &str| baked(&files, "--rigidity", &files.path(name), &[]);
    assert!(of("whole.<UDIM>.exr") == of("cropped.<UDIM>.exr"));
}

#[test]
fn maps_that_cannot_be_meant_are_refused() {
    let files = Files::new("bad_maps");
    let check = |name: &str, reason: &str| {
        let (mut arguments, out) = files.arguments("pose.obj", &[]);
        let at = arguments.iter().position(|a| a == "--rigidity").unwrap();
        arguments[at + 1] = files.path(name);
        refuse(&arguments, &out, &name.replace("<UDIM>", "1001"), reason);
    };
    let mut values = texels(square);
    values[5 * 32 + 7] = f32::NAN;
    write_exr(&files.folder.join("nan.1001.exr"), &[("Y", FlatSamples::F32(values.clone()))]);
    check("nan.<UDIM>.exr", "texel (7, 5) is NaN");
    let two = FlatSamples::F32(vec![0.0; values.len()]);
    write_exr(&files.folder.join("two.1001.exr"), &[("depth", two.clone()), ("id", two)]);
    check("two.<UDIM>.exr", "'depth', 'id'");
    let exr = fs::read(files.folder.join("two.1001.exr")).unwrap();
    files.write("half.1001.exr", &exr[..exr.len() / 2]);
    check("half.<UDIM>.exr", "");
    let file = File::create(files.folder.join("cut.1001.tif")).unwrap();
    TiffEncoder::new(file).and_then(|mut tiff| tiff.write_image::<Gray32Float>(SIDE, SIDE, &values)).unwrap();
    let tiff = fs::read(files.folder.join("cut.1001.tif")).unwrap();
    files.write("cut.1001.tif", &tiff[..tiff.len() / 2]);
    check("cut.<UDIM>.tif", "");
}

#[test]
fn rigidity_per_vertex_is_that_of_a_map() {
    let files = Files::new("vertex_rigidity");
    files.write("ones.txt", b"# the left column is elastic\n0\n1\n1 # the middle\n\n0.0\n1\n1\n");
    let coloured: String = REST
        .lines()
        .map(|line| match line.strip_prefix("v ") {
            Some(place) if place.starts_with("0 ") => format!("{line} 0 0 0\n"),
            Some(_) => format!("{line} 1 1 1\n"),
            None => format!("{line}\n"),
        })
        .collect();
    files.write("colours.obj", coloured.as_bytes());
    let by_text = baked(&files, "--vertex-rigidity", &files.path("ones.txt"), &[]);
    assert!(longest(&by_text) > 0.1, "{}", longest(&by_text));
    assert!(baked(&files, "--vertex-rigidity", &files.path("colours.obj"), &[]) == by_text);
    // The rest mesh's own colours.
    files.write("rest.obj", coloured.as_bytes());
    assert!(baked(&files, "--vertex-rigidity", "colors", &[]) == by_text);
    // A map of the same ramp, from u = 0.1 to u = 0.9: between texel centres it is linear, too. On coarse levels the map goes
    // on beyond the chart, where values per vertex do not, so that the solver takes another way to the same minimum.
    let ramp: Vec<f32> = (0..SIDE * SIDE)
        .map(|k| ((((k % SIDE) as f32 + 0.5) / SIDE as f32 - 0.1) / 0.8).clamp(0.0, 1.0))
        .collect();
    write_exr(&files.folder.join("ramp.1001.exr"), &[("Y", FlatSamples::F32(ramp))]);
    let by_map = baked(&files, "--rigidity", &files.path("ramp.<UDIM>.exr"), &["--quality", "high"]);
    let by_text = baked(&files, "--vertex-rigidity", &files.path("ones.txt"), &["--quality", "high"]);
    let apart = by_map.iter().zip(&by_text).flat_map(|(a, b)| [0, 1].map(|c| (a[c], b[c])));
    let largest =
        apart.map(|(a, b)| (f32::from_bits(a) - f32::from_bits(b)).abs() * SIDE as f32).fold(0.0, f32::max);
    println!("texels between map and vertices: {largest}, moved by {}", longest(&by_map));
    assert!(largest < 0.02 * longest(&by_map), "{largest} of {}", longest(&by_map));
}

#[test]
fn a_mask_per_vertex_holds_what_is_dark() {
    let files = Files::new("vertex_mask");
    let rigid = files.path("r.<UDIM>.png");
    let free = baked(&files, "--rigidity", &rigid, &[]);
    files.write("ones.txt", "1\n".repeat(6).as_bytes());
    assert!(baked(&files, "--rigidity", &rigid, &["--vertex-mask", &files.path("ones.txt")]) == free);
    files.write("zeros.txt", "0\n".repeat(6).as_bytes());
    let held = baked(&files, "--rigidity", &rigid, &["--vertex-mask", &files.path("zeros.txt")]);
    assert!(longest(&free) > 0.1 && longest(&held) < 1e-4, "{} {}", longest(&free), longest(&held));
}

#[test]
fn bad_values_per_vertex_are_refused() {
    let files = Files::new("bad_values");
    let check = |text: &str, reason: &str| {
        files.write("values.txt", text.as_bytes());
        let (arguments, out) = files.arguments("pose.obj", &["--vertex-mask", &files.path("values.txt")]);
        refuse(&arguments, &out, "values.txt", reason);
    };
    check("1\n1\n", "2 values, but the rest mesh has 6 vertices");
    check("1\n1\none\n", "line 3: 'one' is not a number");
    check("1\nnan\n", "line 2: 'nan' is not a number");
    let (arguments, out) = files.arguments("pose.obj", &["--vertex-mask", "colors"]);
    refuse(&arguments, &out, "rest.obj", "line 2: the vertex has no colour");
}

/// Two faces over the same texels: nothing may move there, and the bake says so once, whatever the number of frames.
#[test]
fn uvs_that_overlap_are_told() {
    let files = Files::new("stacked");
    let stacked = REST.replace("f 2/5 3/6 6/7 5/8", "f 2/1 3/2 6/3 5/4");
    files.write("rest.obj", stacked.as_bytes());
    files.write("pose.obj", stacked.replace("v 0 1 0", "v 0 1.4 0.2").as_bytes());
    let pose = files.path("pose.obj");
    let (arguments, out) =
        files.arguments("pose.obj", &["--pose", &pose, "--weld", "off", "--size", "32", "--no-sheet"]);
    let (_, warnings) = succeed_with_warnings(&borrow(&arguments));
    let told = |what: &str| warnings.lines().filter(|line| line.contains(what)).count();
    assert_eq!((told("overlapped"), told("nothing that may move")), (1, 1), "{warnings}");
    let report = report(&out);
    assert_eq!(report["frames"].as_array().unwrap().len(), 2);
    assert_eq!(report["tiles"][0]["frozen"], 1.0);
    let strain = &report["frames"][0]["tiles"][0]["strain"];
    assert!(strain["edges"] == 0 && strain["edges_fixed"].as_u64() > Some(50), "{strain}");
    assert!(strain["fixed"].as_f64() > Some(0.05), "{strain}");
}
