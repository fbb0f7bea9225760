//! A user's own files: poses and maps, what each map tells of itself, and what is warned of.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use exr::meta::attribute::AttributeValue;
use image::{ImageBuffer, Luma};
use serde_json::Value;

use crate::common::{
    Files, REST, borrow, floats, folder, layer, names, read_exr, refuse, report, succeed,
    succeed_with_warnings, text,
};

#[test]
fn a_users_own_files_bake_and_a_tile_without_a_map_is_the_identity() {
    let files = Files::new("files");
    fs::remove_file(files.path("r.1002.png")).unwrap();
    let (arguments, out) = files.arguments("pose.obj", &[]);
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

#[test]
fn sixteen_bits_are_kept_and_of_colours_the_luminance_counts() {
    let files = Files::new("bits");
    let baked = |name: &str| {
        let (mut arguments, out) = files.arguments("pose.obj", &["--no-sheet", "--size", "32"]);
        let at = arguments.iter().position(|a| a == "--rigidity").unwrap();
        arguments[at + 1] = files.path(name);
        succeed_with_warnings(&borrow(&arguments));
        let bits = |uv: &[f32; 2]| uv.map(f32::to_bits);
        read_exr(&out.join("redirect.0001.1001.exr")).2.iter().map(bits).collect::<Vec<_>>()
    };
    // A soft spot, in 65536 steps.
    let spot = |x: u32, y: u32| {
        let [dx, dy] = [x, y].map(|k| (k as f32 - 15.0) / 12.0);
        (65535.0 * (1.0 - (dx * dx + dy * dy).min(1.0))) as u16
    };
    let path = |name: &str| files.folder.join(name);
    ImageBuffer::from_fn(32, 32, |x, y| Luma([spot(x, y)])).save(path("deep.1001.png")).unwrap();
    ImageBuffer::from_fn(32, 32, |x, y| image::Rgb([spot(x, y); 3])).save(path("colour.1001.png")).unwrap();
    ImageBuffer::from_fn(32, 32, |x, y| Luma([(spot(x, y) >> 8) as u8])).save(path("flat.1001.png")).unwrap();
    let deep = baked("deep.<UDIM>.png");
    assert!(baked("colour.<UDIM>.png") == deep);
    assert!(baked("flat.<UDIM>.png") != deep);
}

/// The attributes of a file, as text.
fn attributes(path: &Path) -> BTreeMap<String, String> {
    let own = layer(path).attributes;
    let mut all: BTreeMap<String, String> = own
        .other
        .iter()
        .map(|(name, value)| {
            let text = match value {
                AttributeValue::Text(text) => text.to_string(),
                AttributeValue::I32(number) => number.to_string(),
                other => panic!("{name}: {other:?}"),
            };
            (name.to_string(), text)
        })
        .collect();
    for (name, value) in [("software", own.software_name), ("wrapmodes", own.wrap_mode_name)] {
        all.insert(name.into(), value.expect(name).to_string());
    }
    all
}

#[test]
fn a_file_tells_what_it_holds() {
    let out = folder("attributes");
    succeed(&["--size", "32", "--frames", "4", "--no-sheet", "--no-film", "--out", text(&out)]);
    let version = env!("CARGO_PKG_VERSION");
    let hash = |of: &BTreeMap<String, String>| of["vrtm:inputs"].clone();
    let mut hashes = Vec::new();
    for (name, kind) in [("redirect.0004.1001.exr", "redirect"), ("warp.0004.1001.exr", "warp")] {
        let found = attributes(&out.join(name));
        let expected = [
            ("colorInteropID", "data"),
            ("oiio:ColorSpace", "data"),
            ("software", concat!("vrtm ", env!("CARGO_PKG_VERSION"))),
            ("vrtm:form", "tile"),
            ("vrtm:frame", "4"),
            ("vrtm:kind", kind),
            ("vrtm:udim", "1001"),
            ("vrtm:version", version),
            ("wrapmodes", "clamp"),
        ];
        for (name, value) in expected {
            assert_eq!(found[name], value, "{name}");
        }
        assert_eq!(found.len(), expected.len() + 1, "{found:?}");
        assert!(hash(&found).len() == 32 && hash(&found).bytes().all(|b| b.is_ascii_hexdigit()));
        hashes.push(hash(&found));
    }
    assert_ne!(hashes[0], hashes[1]);
}

#[test]
fn the_hash_of_inputs_follows_what_the_content_depends_on_and_nothing_else() {
    let files = Files::new("hashes");
    files.write("other.obj", REST.replace("v 0 1 0", "v 0 1.2 0").as_bytes());
    let hashes = |more: &[&str]| {
        let (mut arguments, _) = files.arguments("other.obj", &["--pose", &files.path("pose.obj")]);
        let out = folder("hashes_out");
        let at = arguments.iter().position(|a| a == "--out").unwrap();
        arguments[at + 1] = text(&out).into();
        arguments.extend(["--no-sheet", "--device", "cpu"].iter().chain(more).map(|word| word.to_string()));
        succeed(&borrow(&arguments));
        let of =
            |file| (attributes(&out.join(file))["vrtm:inputs"].clone(), fs::read(out.join(file)).unwrap());
        ["redirect.0002.1001.exr", "warp.0002.1001.exr", "redirect.0002.1002.exr"].map(of)
    };
    // The very same bytes, whichever other frames are baked.
    let first = hashes(&[]);
    assert!(hashes(&["--frames", "2"]) == first);
    let hash_of = |all: [(String, Vec<u8>); 3]| all.map(|(hash, _)| hash);
    let first = hash_of(first);
    assert_eq!(first.iter().collect::<std::collections::HashSet<_>>().len(), 3);
    // With a warm start, a frame depends on those before it.
    let warm = hash_of(hashes(&["--warm"]));
    for other in [hash_of(hashes(&["--size", "64"])), hash_of(hashes(&["--quality", "draft"])), warm.clone()]
    {
        assert!((0..3).all(|k| other[k] != first[k]));
    }
    assert!(hash_of(hashes(&["--warm", "--frames", "2"])) != warm);
    // The size of the map does not change the warp, nor does one tile's map change another tile.
    let other = hash_of(hashes(&["--map-size", "16"]));
    assert!(other[0] != first[0] && other[1] == first[1] && other[2] != first[2]);
    image::GrayImage::from_pixel(32, 32, Luma([90])).save(files.path("r.1001.png")).unwrap();
    let other = hash_of(hashes(&[]));
    assert!(other[0] != first[0] && other[1] != first[1] && other[2] == first[2]);
}

#[test]
fn a_pose_in_other_units_is_warned_of() {
    let files = Files::new("units");
    let scaled = |factor: f32| -> Vec<u8> {
        let rest = [[0., 0.], [1., 0.], [2., 0.], [0., 1.], [1., 1.], [2., 1.]];
        floats(&rest.map(|[x, y]: [f32; 2]| [x * factor, y * factor, 0.0]).concat())
    };
    let poses = [scaled(1.0), scaled(100.0), scaled(2.0), scaled(0.01)].concat();
    files.write("scaled.f32", &poses);
    let (arguments, out) = files.arguments("scaled.f32", &["--no-sheet"]);
    let (_, warnings) = succeed_with_warnings(&borrow(&arguments));
    let lines: Vec<&str> = warnings.lines().collect();
    assert_eq!(lines.len(), 2, "{warnings}");
    for (line, frame, factor) in
        [(lines[0], "frame 2", "100.000 times"), (lines[1], "frame 4", "0.010 times")]
    {
        assert!(line.starts_with("bake: warning: "), "{line}");
        assert!(line.contains(frame) && line.contains(factor) && line.contains("scaled.f32"), "{line}");
    }
    let frames = &report(&out)["frames"];
    let stretch: Vec<f64> = (0..4).map(|k| frames[k]["asset"]["median_stretch"].as_f64().unwrap()).collect();
    for (stretch, factor) in stretch.iter().zip([1.0, 100.0, 2.0, 0.01]) {
        assert!((stretch / factor - 1.0).abs() < 1e-5, "{stretch} {factor}");
    }
}

/// OBJ files as exact as they are: coordinates of a survey, hundreds of kilometres from the origin.
#[test]
fn far_from_the_origin_the_maps_are_those_of_the_same_mesh_near_it() {
    let files = Files::new("far");
    let baked = |rest: &str, pose: &str| {
        let (mut arguments, out) = files.arguments(pose, &["--no-sheet", "--device", "cpu"]);
        arguments[1] = files.path(rest);
        succeed(&borrow(&arguments));
        let strain = &report(&out)["frames"][0]["tiles"][0]["strain"]["after"]["rms"];
        (read_exr(&out.join("redirect.0001.1001.exr")).2, strain.as_f64().expect("a number"))
    };
    let (near, strain) = baked("rest.obj", "pose.obj");
    for name in ["rest", "pose"] {
        let text = fs::read_to_string(files.path(&format!("{name}.obj"))).expect("the mesh");
        let moved = |line: &str| match line.strip_prefix("v ").map(|p| p.split(' ').collect::<Vec<_>>()) {
            Some(p) => {
                let [x, y, z] = [0, 1, 2].map(|c| p[c].parse::<f64>().expect("a number"));
                format!("v {} {} {}\n", x + 448_262.25, y + 5_411_932.5, z + 120.0)
            }
            None => format!("{line}\n"),
        };
        files.write(&format!("far_{name}.obj"), text.lines().map(moved).collect::<String>().as_bytes());
    }
    let (far, strain_far) = baked("far_rest.obj", "far_pose.obj");
    // The coordinates have 1e-9 there, which the solve amplifies; a hundredth of a texel of 4096 is 2.4e-6.
    let apart = near.iter().zip(&far).flat_map(|(a, b)| [(a[0] - b[0]).abs(), (a[1] - b[1]).abs()]);
    let apart = apart.fold(0.0, f32::max);
    assert!(apart < 2.4e-6, "{apart}");
    assert!((strain - strain_far).abs() < 1e-4, "{strain} {strain_far}");
    let centre = |i: usize| [(i % 32) as f32 + 0.5, 31.5 - (i / 32) as f32].map(|x| x / 32.0);
    assert!(far.iter().enumerate().any(|(i, uv)| (uv[1] - centre(i)[1]).abs() > 1e-3), "not the identity");
}

#[test]
fn tiles_have_the_tokens_of_other_programs() {
    let files = Files::new("tokens");
    let maps = |pattern: &str, names: [&str; 2]| {
        for (udim, name) in [1001, 1002].into_iter().zip(names) {
            fs::copy(files.path(&format!("r.{udim}.png")), files.path(name)).expect("a copy");
        }
        let (mut arguments, out) = files.arguments("pose.obj", &["--no-sheet", "--size", "16"]);
        let at = arguments.iter().position(|a| a == "--rigidity").unwrap();
        arguments[at + 1] = files.path(pattern);
        succeed(&borrow(&arguments));
        let tiles = &report(&out)["tiles"];
        for (k, name) in names.iter().enumerate() {
            assert!(
                tiles[k]["rigidity"].as_str().is_some_and(|file| file.ends_with(name)),
                "{name}: {tiles}"
            );
        }
    };
    maps("p%(UDIM)d.png", ["p1001.png", "p1002.png"]);
    maps("t_<UVTILE>.png", ["t_u1_v1.png", "t_u2_v1.png"]);
    maps("t_u<U>_v<V>.png", ["t_u1_v1.png", "t_u2_v1.png"]);
    maps("z_<u>_<v>.png", ["z_u0_v0.png", "z_u1_v0.png"]);
    maps("z<uvtile>.png", ["zu0_v0.png", "zu1_v0.png"]);
    for (pattern, reason) in [
        ("r.1001.png", "write <UDIM>"),
        ("t_v<V>.png", "write <UDIM>"),
        ("r.<TILE>.png", "write <UDIM>"),
        ("r_<UDIM>.png", "no such file"),
    ] {
        let (mut arguments, _) = files.arguments("pose.obj", &[]);
        let at = arguments.iter().position(|a| a == "--rigidity").unwrap();
        arguments[at + 1] = files.path(pattern);
        let out = files.folder.join("none");
        arguments[at + 3] = text(&out).into();
        refuse(&arguments, &out, pattern, reason);
    }
}

#[test]
fn maps_of_the_wrong_range_and_poses_out_of_order_are_warned_of() {
    let files = Files::new("ranges");
    let warned = |more: &[&str]| {
        let (arguments, _) = files.arguments("pose.obj", &[&["--no-sheet", "--size", "16"], more].concat());
        succeed_with_warnings(&borrow(&arguments)).1
    };
    let path = files.path("r.1001.png");
    ImageBuffer::from_fn(32, 32, |x, _| Luma([u8::from(x > 9)])).save(&path).expect("a map");
    assert!(warned(&[]).contains("r.1001.png has no value above 1 of 255: next to nothing keeps"));
    ImageBuffer::from_fn(32, 32, |x, _| Luma([x as u16 * 8])).save(&path).expect("a map");
    assert!(warned(&[]).contains("r.1001.png has no value above 248 of 65535"));
    image::GrayImage::new(32, 32).save(&path).expect("a map");
    let warnings = warned(&[]);
    assert!(warnings.contains("r.1001.png") && warnings.contains("r.1002.png: black all over"), "{warnings}");
    image::GrayImage::from_pixel(32, 32, Luma([26])).save(&path).expect("a map");
    assert_eq!(warned(&[]), "");

    files.write("rest.obj", REST.replace("1/1", "1").as_bytes());
    assert!(warned(&[]).contains("rest.obj: faces without UVs (vt), which are not baked: 1"));
    files.write("rest.obj", REST.as_bytes());

    let poses = ["sim.-0001.obj", "sim.-0002.obj", "sim.0000.obj"].map(|name| {
        files.write(name, REST.as_bytes());
        files.path(name)
    });
    let [a, b, c] = [0, 1, 2].map(|k| poses[k].as_str());
    let warnings = warned(&["--pose", a, b, c]);
    assert!(warnings.contains("sim.-0001.obj comes before ") && warnings.lines().count() == 1, "{warnings}");
    assert_eq!(warned(&["--pose", b, a, c]), "");
}

/// A sheet of 20 by 20 squares, as an OBJ, and its vertices.
fn sheet() -> (String, Vec<[f32; 3]>) {
    let points: Vec<[f32; 3]> = (0..441).map(|k| [(k % 21) as f32, (k / 21) as f32, 0.0]).collect();
    let mut obj = String::new();
    for [x, y, z] in &points {
        obj += &format!("v {x} {y} {z}\nvt {} {}\n", x / 20.0, y / 20.0);
    }
    for k in (0..420).filter(|k| k % 21 < 20) {
        let corners = [k + 1, k + 2, k + 23, k + 22].map(|v| format!("{v}/{v}"));
        obj += &format!("f {}\n", corners.join(" "));
    }
    (obj, points)
}

#[test]
fn vertices_in_another_order_are_warned_of() {
    let files = Files::new("order");
    let (obj, points) = sheet();
    files.write("rest.obj", obj.as_bytes());
    // A tenth of the vertices changes places with their mirror images.
    let mut mixed = points.clone();
    (0..22).for_each(|k| mixed.swap(k, 440 - k));
    files.write("mixed.f32", &floats(&[points, mixed].concat().concat()));
    let (arguments, out) = files.arguments("mixed.f32", &["--no-sheet"]);
    let (_, warnings) = succeed_with_warnings(&borrow(&arguments));
    let order: Vec<&str> = warnings.lines().filter(|line| line.contains("order of the rest mesh")).collect();
    assert!(order.len() == 1 && order[0].contains("frame 2") && order[0].contains("mixed.f32"), "{warnings}");
    let asset = &report(&out)["frames"][1]["asset"];
    assert!(asset["median_stretch"].as_f64().unwrap() < 1.5, "{asset}");
    assert!(asset["stretched_share"].as_f64().unwrap() > 0.05, "{asset}");
}

/// Output may go to a file on a full disk: the maps are there in any case.
#[test]
#[cfg(target_os = "linux")]
fn a_bake_does_not_fail_for_what_it_prints() {
    let files = Files::new("full_log");
    fs::remove_file(files.path("r.1002.png")).unwrap();
    let (arguments, out) = files.arguments("pose.obj", &["--no-sheet"]);
    let full = || fs::File::options().write(true).open("/dev/full").expect("/dev/full");
    let mut bake = crate::common::command();
    // A tile without a map is warned of.
    bake.args(&arguments).stdout(full()).stderr(full());
    assert_eq!(bake.status().expect("bake runs").code(), Some(0));
    assert!(names(&out).contains(&"report.json".to_string()));
    let mut refused = crate::common::command();
    refused.args(arguments).args(["--frames", "99"]).stderr(full());
    assert_eq!(refused.status().expect("bake runs").code(), Some(2));
}
