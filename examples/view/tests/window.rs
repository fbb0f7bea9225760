//! Opens the real window under Xvfb, drives it with the mouse, and compares what is on the screen. Skipped with a word
//! where there is no X server, no xdotool or no GPU driver; a software driver will do.

#[path = "window/gltf.rs"]
mod gltf;
#[path = "window/program.rs"]
mod program;
#[path = "window/screen.rs"]
mod screen;
#[allow(dead_code)]
mod tiny;

use std::path::{Path, PathBuf};

use program::Program;
use screen::{Server, Shot};
use serde_json::Value;

/// A window whose view is wide enough that each half of it shows the mesh as large as the whole does.
const SIZE: &str = "1500x620";
/// The name of a pane lies over its upper left corner.
const LABEL: [u32; 2] = [140, 40];

/// An X server and a folder, or nothing with a word why.
fn start(name: &str) -> Option<(Server, PathBuf)> {
    let reason = if !program::is_there("Xvfb") {
        "no Xvfb"
    } else if !program::is_there("xdotool") {
        "no xdotool"
    } else if vrtm::adapters().is_empty() {
        "no GPU adapter to draw a window with"
    } else {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("view-{name}"));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a folder");
        return Some((Server::start(&folder, [1500, 620]), folder));
    };
    println!("skipped: {reason}");
    None
}

/// Chooses from a menu.
fn choose(view: &Program, menu: &str, what: &str) {
    view.click(menu);
    view.click(what);
}

/// The final picture of the view, with its place.
fn settled(server: &Server, view: &mut Program) -> (Shot, [u32; 4]) {
    view.wait("drawn", |event| event["purpose"] == "final");
    let area = view.widget("view");
    (server.shot().cut(area), area)
}

/// Pixels in the middle of the left and of the right part of a sheet.
fn sides(shot: &Shot) -> [[u8; 3]; 2] {
    let middle = shot.size[1] / 2;
    [3, 5].map(|k| shot.pixels[(middle * shot.size[0] + k * shot.size[0] / 8) as usize])
}

fn rms(event: &Value) -> [f64; 2] {
    [0, 1].map(|k| event["strain"]["rms"][k].as_f64().expect("strain was measured"))
}

fn is_final(event: &Value, frame: u64) -> bool {
    event["purpose"] == "final" && event["frame"] == frame
}

#[test]
fn the_timeline_the_panes_and_the_quality() {
    let Some((server, folder)) = start("timeline") else { return };
    let options = ["--scene", "mug_to_jug", "--size", SIZE, "--frame", "1", "--view", "redirected"];
    let mut view = Program::start(&server, &folder, &options);
    let (at_rest, area) = settled(&server, &mut view);

    // Dragging shows frames on the way, and ends with the chosen quality.
    let [left, top, right, bottom] = view.widget("timeline");
    let y = (top + bottom) / 2;
    let way: Vec<[u32; 2]> = (0..=20).map(|k| [left + (right - left) * k / 20, y]).collect();
    view.drag(&way);
    let normal = view.wait("solve", |event| is_final(event, 121));
    view.wait("drawn", |event| is_final(event, 121));
    let passed =
        |event: &Value| event["event"] == "drawn" && (2..121).contains(&event["frame"].as_u64().unwrap_or(0));
    assert!(view.events().any(|event| passed(&event)), "nothing was shown while the timeline was dragged");
    let [before, after] = rms(&normal);
    assert!(before > 0.25 && after < 0.1 * before, "strain {before} -> {after}");
    assert!(normal["min_jacobian"].as_f64().expect("a number") > 0.0 && normal["folds"] == 0);
    let jug = server.shot().cut(area);
    assert!(jug.differing(&at_rest) > 0.1, "the picture did not change");

    // The saved picture is what the window shows, without what lies over it.
    choose(&view, "save", "save picture");
    view.wait("saved", |_| true);
    let saved = Shot::open(&folder.join("mug_to_jug_0121.png"));
    assert_eq!(saved.size, [area[2] - area[0], area[3] - area[1]]);
    assert!(saved.without(LABEL).differing(&jug.without(LABEL)) < 1e-4);

    view.click("quality draft");
    let draft = view.wait("solve", |event| is_final(event, 121) && event["quality"] == "draft");
    assert!(rms(&draft)[1] > after, "draft {} is not above normal {after}", rms(&draft)[1]);
    view.click("quality normal");
    view.wait("drawn", |event| is_final(event, 121) && event["quality"] == "normal");
    view.click("side by side");
    view.wait("drawn", |event| event["panes"] == serde_json::json!([false, true]));
    let both = server.shot().cut(area);
    view.quit();

    // Beginning at a frame shows what dragging to it shows; and each half shows what its pane alone does.
    let options = ["--scene", "mug_to_jug", "--size", SIZE, "--frame", "121", "--view", "original"];
    let mut view = Program::start(&server, &folder, &options);
    let (original, _) = settled(&server, &mut view);
    view.click("redirected");
    view.wait("drawn", |event| event["panes"] == serde_json::json!([true]));
    let redirected = server.shot().cut(area);
    // A wipe has the one on the left of its line, and the other on the right.
    view.click("wipe");
    view.wait("drawn", |event| event["panes"] == serde_json::json!([false, true]));
    let wipe = server.shot().cut(area);
    view.quit();
    let [middle, top] = [wipe.size[0] / 2, LABEL[1]];
    for (place, one) in [
        ([0, top, middle - 12, wipe.size[1]], &original),
        ([middle + 12, top, wipe.size[0], wipe.size[1]], &redirected),
    ] {
        let share = wipe.cut(place).differing(&one.cut(place));
        assert!(share < 1e-4, "{share} of {place:?} differs from the pane alone");
    }
    let same = redirected.differing(&jug);
    assert!(same < 1e-4, "{same} of the pixels differ from those after dragging");
    assert!(original.differing(&redirected) > 0.05, "the redirection changes nothing");
    let (width, height) = (jug.size[0], jug.size[1]);
    for (pane, whole) in [(0, &original), (1, &redirected)] {
        let half = both.cut([pane * width / 2, 0, (pane + 1) * width / 2, height]);
        let middle = whole.cut([width / 4, 0, 3 * width / 4, height]);
        // Edges may fall on the other side of a pixel's samples; the names of the panes lie elsewhere.
        let share = half.without(LABEL).differing(&middle.without(LABEL));
        assert!(share < 0.01, "{share} of pane {pane} differs from the pane alone");
    }
}

/// The first view shows the pose that stretches most, without and with the redirection.
#[test]
fn it_opens_side_by_side_in_the_pose_that_stretches_most() {
    let Some((server, folder)) = start("first") else { return };
    let mut view = Program::start(&server, &folder, &["--scene", "creature", "--size", SIZE]);
    let drawn = view.wait("drawn", |event| event["purpose"] == "final");
    assert_eq!(drawn["panes"], serde_json::json!([false, true]));
    assert!(drawn["frame"].as_u64().is_some_and(|frame| frame > 1 && frame % 24 == 1), "{drawn}");
    // At rest both sides are alike.
    let area = view.widget("view");
    let shot = server.shot().cut(area);
    let (width, height) = (shot.size[0], shot.size[1]);
    let [left, right] = [0, 1].map(|pane| shot.cut([pane * width / 2, 0, (pane + 1) * width / 2, height]));
    assert!(left.without(LABEL).differing(&right.without(LABEL)) > 0.02);
    view.quit();
}

/// Seams continue, with textures that show what is beyond.
#[test]
fn seams_that_continue() {
    let Some((server, folder)) = start("seams") else { return };
    let options = ["--scene", "mug_to_jug", "--size", SIZE, "--frame", "121", "--view", "redirected"];
    let mut view = Program::start(&server, &folder, &options);
    let solved = view.wait("solve", |event| is_final(event, 121));
    let (shut, area) = settled(&server, &mut view);
    view.click("Seams");
    view.click("Seams Continue");
    let continued = view.wait("solve", |event| is_final(event, 121) && event["edit"] != solved["edit"]);
    assert!(continued["folds"] == 0 && rms(&continued)[1] < 1.1 * rms(&solved)[1], "{continued}");
    view.wait("drawn", |event| is_final(event, 121) && event["edit"] == continued["edit"]);
    // Most of the surface is far from any seam.
    let share = server.shot().cut(area).differing(&shut);
    assert!((1e-4..0.2).contains(&share), "{share} of the pixels differ");
    view.quit();
}

/// A sheet that is stretched to twice its width, without a rigidity map.
fn sheet(folder: &Path) -> [String; 2] {
    let cells = 8;
    ["rest.obj", "wide.obj"].map(|name| {
        let stretch = if name == "rest.obj" { 1.0 } else { 2.0 };
        let mut text = String::new();
        for k in 0..=cells {
            for i in 0..=cells {
                let [u, v] = [i, k].map(|x| f64::from(x) / f64::from(cells));
                // Wide in all poses, so that the view is filled alike.
                text +=
                    &format!("v {} {v} 0\nvt {} {}\n", stretch * (u - 0.5), 0.02 + 0.96 * u, 0.02 + 0.96 * v);
            }
        }
        for k in 0..cells {
            for i in 0..cells {
                let corner = |i: i32, k: i32| k * (cells + 1) + i + 1;
                let face = [corner(i, k), corner(i + 1, k), corner(i + 1, k + 1), corner(i, k + 1)];
                text += &format!("f {0}/{0} {1}/{1} {2}/{2} {3}/{3}\n", face[0], face[1], face[2], face[3]);
            }
        }
        let path = folder.join(name);
        std::fs::write(&path, text).expect("written");
        path.display().to_string()
    })
}

/// A texture of two colours, red on the left half of the tile and blue on the right half, is what the sheet shows.
#[test]
fn a_texture_is_drawn_in_place_of_the_material() {
    let Some((server, folder)) = start("texture") else { return };
    let [rest, wide] = sheet(&folder);
    let half = |k: usize| if k % 64 < 32 { [255, 0, 0] } else { [0, 0, 255] };
    let pixels: Vec<u8> = (0..64 * 64).flat_map(half).collect();
    let pattern = folder.join("skin.<UDIM>.png").display().to_string();
    image::save_buffer(pattern.replace("<UDIM>", "1001"), &pixels, 64, 64, image::ColorType::Rgb8)
        .expect("a PNG");
    let options =
        ["--rest", &rest, "--pose", &wide, "--texture", &pattern, "--view", "original", "--size", SIZE];
    let mut view = Program::start(&server, &folder, &options);
    let [left, right] = sides(&settled(&server, &mut view).0);
    view.quit();
    assert!(left[0] > 100 && left[2] < 60 && right[2] > 100 && right[0] < 60, "{left:?} {right:?}");
    // A path that leads nowhere is named.
    let pattern = folder.join("no.<UDIM>.png").display().to_string();
    let options = ["--rest", &rest, "--pose", &wide, "--texture", &pattern, "--size", SIZE];
    let mut view = Program::start(&server, &folder, &options);
    let notice = view.wait("notice", |_| true);
    assert!(notice["text"].as_str().expect("a text").starts_with(&pattern), "{notice}");
    view.quit();
}

/// The light comes from the left: what a normal map tilts to the left is lighter than what it tilts to the right.
#[test]
fn a_normal_map_is_lit() {
    let Some((server, folder)) = start("normal") else { return };
    let [rest, wide] = sheet(&folder);
    let save = |name: &str, left: [u8; 3], right: [u8; 3]| {
        let path = folder.join(name).display().to_string();
        let pixels: Vec<u8> = (0..64 * 64).flat_map(|k| if k % 64 < 32 { left } else { right }).collect();
        let saved = image::save_buffer(&path, &pixels, 64, 64, image::ColorType::Rgb8);
        saved.expect("a PNG");
        path
    };
    let grey = save("grey.png", [120; 3], [120; 3]);
    // Directions of -0.5 and 0.5 in u, and 0.87 out of the surface.
    let normal = save("normal.png", [64, 128, 238], [191, 128, 238]);
    let options = ["--rest", &rest, "--pose", &wide, "--texture", &grey, "--normal", &normal, "--size", SIZE];
    for pane in ["original", "redirected"] {
        let mut view = Program::start(&server, &folder, &[&options[..], &["--view", pane]].concat());
        let [left, right] = sides(&settled(&server, &mut view).0);
        view.quit();
        // The shader's light on these directions gives 113 and 94.
        assert!((110..117).contains(&left[1]) && (88..98).contains(&right[1]), "{pane}: {left:?} {right:?}");
    }
}

#[test]
fn the_brush_and_what_is_saved() {
    let Some((server, folder)) = start("brush") else { return };
    let [rest, wide] = sheet(&folder);
    let options = ["--rest", &rest, "--pose", &wide, "--frame", "25", "--view", "original", "--size", SIZE];
    let mut view = Program::start(&server, &folder, &options);
    let first = view.wait("solve", |event| is_final(event, 25));
    assert!(first["strain"].is_null(), "nothing is rigid yet");
    view.wait("drawn", |event| is_final(event, 25));
    let area = view.widget("view");
    view.click("brush");
    view.wait("layout", |event| event["widgets"]["radius"].is_array());
    let before = server.shot().cut(area);

    // A stroke in the middle changes the picture there and nowhere else, and what it makes rigid keeps its shape.
    let middle = [(area[0] + area[2]) / 2, (area[1] + area[3]) / 2];
    let way: Vec<[u32; 2]> = (0..=8).map(|k| [middle[0] - 24 + 6 * k, middle[1]]).collect();
    view.drag(&way);
    let painted = view.wait("solve", |event| is_final(event, 25) && !event["strain"].is_null());
    let edit = painted["edit"].clone();
    view.wait("drawn", |event| is_final(event, 25) && event["edit"] == edit);
    assert!(view.events().any(|event| event["event"] == "paint" && event["tile"] == 1001));
    view.move_away();
    let after = server.shot().cut(area);
    let changed = after.changes(&before);
    let [x, y] = [middle[0] - area[0], middle[1] - area[1]];
    // The brush's radius is 28 points; a texel of the map is some pixels wide.
    let inside = |&&[px, py]: &&[u32; 2]| px.abs_diff(x) <= 24 + 34 && py.abs_diff(y) <= 34;
    assert_eq!(changed.iter().filter(inside).count(), changed.len(), "changes beside the brush");
    assert!(changed.len() > 2000, "only {} pixels changed", changed.len());
    let [old, new] = rms(&painted);
    assert!(old > 0.3 && new < 0.25 * old, "strain of what was painted: {old} -> {new}");

    // The map is saved: white where the brush was, black elsewhere.
    choose(&view, "save", "save rigidity maps");
    view.wait("saved", |_| true);
    let path = folder.join("rest_rigidity.1001.png");
    let map = image::open(&path).expect("a PNG").into_luma8();
    assert_eq!(map.dimensions(), (512, 512));
    assert_eq!(
        (map.get_pixel(256, 256).0, map.get_pixel(256, 100).0, map.get_pixel(60, 256).0),
        ([255], [0], [0])
    );
    // Nothing is replaced unless the user says so.
    std::fs::write(&path, "mine").expect("written");
    choose(&view, "save", "save rigidity maps");
    view.wait("layout", |event| event["widgets"]["keep"].is_array());
    view.click("keep");
    view.wait("layout", |event| event["widgets"]["keep"].is_null());
    assert_eq!(std::fs::read(&path).expect("read"), b"mine");
    choose(&view, "save", "save rigidity maps");
    view.click("replace");
    view.wait("saved", |_| true);
    assert_eq!(image::open(&path).expect("a PNG").into_luma8(), map);

    view.click("undo");
    view.wait("solve", |event| is_final(event, 25) && event["strain"].is_null());
    view.wait("drawn", |event| is_final(event, 25));
    let undone = server.shot().cut(area).changes(&before).len();
    assert_eq!(undone, 0, "pixels differ after undoing");

    view.quit();
    let left: Vec<_> =
        std::fs::read_dir(&folder).expect("the folder").flatten().map(|e| e.file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().ends_with(".part")), "{left:?}");
}

/// Dialogs open what is chosen in them; where there are none the window says so, and all that was open stays.
#[cfg(unix)]
#[test]
fn dialogs_open_files_and_say_where_there_are_none() {
    use std::os::unix::fs::PermissionsExt;

    let Some((server, folder)) = start("dialogs") else { return };
    let [rest, wide] = sheet(&folder);
    let mut view = Program::start(&server, &folder, &["--rest", &rest, "--size", SIZE]);
    view.wait("drawn", |event| event["purpose"] == "final");
    choose(&view, "open", "mesh at rest...");
    let notice = view.wait("notice", |_| true);
    assert!(notice["text"].as_str().expect("a text").starts_with("no file dialog here"), "{notice}");
    // A program in the place of zenity, which the dialogs fall back to, chooses.
    let chooses = |path: &str| {
        let program = folder.join("bin/zenity");
        std::fs::create_dir_all(folder.join("bin")).expect("a folder");
        std::fs::write(&program, format!("#!/bin/sh\necho '{path}'\n")).expect("written");
        std::fs::set_permissions(&program, std::fs::Permissions::from_mode(0o755)).expect("a program");
    };
    chooses(&wide);
    choose(&view, "open", "mesh at rest...");
    let opened = view.wait("open", |event| event["name"] == "wide");
    assert_eq!(opened["poses"], 0);
    chooses(&rest);
    choose(&view, "open", "poses...");
    view.wait("open", |event| event["poses"] == 1);
    view.wait("drawn", |event| event["purpose"] == "final");
    view.quit();
}

#[test]
fn a_missing_file_is_named_in_the_window() {
    let Some((server, folder)) = start("missing") else { return };
    let mut view = Program::start(&server, &folder, &["--asset", "no/such/folder", "--size", SIZE]);
    let notice = view.wait("notice", |_| true);
    let text = notice["text"].as_str().expect("a text");
    assert!(text.starts_with("no/such/folder") && text.contains("No such file"), "{text}");
    // The window still works: a scene can be opened from its menu.
    view.click("open");
    view.click("scene squash");
    view.wait("drawn", |event| is_final(event, 25));
    view.quit();
}
