//! A glTF file in the window: its texture, its frames, its animations, and what is dropped of it.

use crate::program::Program;
use crate::tiny::Tiny;
use crate::{SIZE, start};

/// A file brings its mesh, poses and texture; another animation of it leaves what is painted.
#[test]
fn a_gltf_file_is_opened_with_its_texture_and_its_animations() {
    let Some((server, folder)) = start("gltf") else { return };
    let mut tiny = Tiny::strip();
    let half = |k: u32| image::Rgb(if k < 32 { [255u8, 0, 0] } else { [0, 0, 255] });
    let skin = image::RgbImage::from_fn(64, 64, |x, _| half(x));
    let mut png = std::io::Cursor::new(Vec::new());
    skin.write_to(&mut png, image::ImageFormat::Png).expect("encoded");
    tiny.texture(&png.into_inner());
    let path = folder.join("strip.glb");
    std::fs::write(&path, tiny.glb()).expect("written");
    let path = path.display().to_string();
    let options = ["--rest", &path, "--fps", "12", "--frame", "0", "--view", "original", "--size", SIZE];
    let mut view = Program::start(&server, &folder, &options);
    let opened = view.wait("open", |_| true);
    assert_eq!((&opened["name"], &opened["poses"]), (&"strip".into(), &13.into()));
    // Frames -24 to -1 lead from rest to frame 0.
    view.wait("drawn", |event| event["purpose"] == "final" && event["frame"] == 25);
    let area = view.widget("view");
    let shot = server.shot().cut(area);
    let is = |red: bool| {
        let fits = |p: &&[u8; 3]| if red { p[0] > 100 && p[2] < 60 } else { p[2] > 100 && p[0] < 60 };
        shot.pixels.iter().filter(fits).count() as f64 / shot.pixels.len() as f64
    };
    assert!(is(true) > 0.02 && is(false) > 0.02, "{} red, {} blue", is(true), is(false));

    view.click("Animation");
    view.click("Animation short");
    let opened = view.wait("open", |_| true);
    assert_eq!(opened["poses"], 7);
    view.wait("drawn", |event| event["purpose"] == "final");
    view.quit();

    let mut view = Program::start(&server, &folder, &["--rest", &path, "--mesh", "hat", "--size", SIZE]);
    let notice = view.wait("notice", |_| true);
    assert!(notice["text"].as_str().is_some_and(|text| text.contains("there are: strip")), "{notice}");
    view.quit();
}
