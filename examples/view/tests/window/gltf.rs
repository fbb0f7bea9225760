//! A glTF file in the window: its texture, its frames, its animations, and what is dropped of it.

use crate::program::Program;
use crate::screen::Shot;
use crate::tiny::Tiny;
use crate::{SIZE, settled, start};

/// A file brings its mesh, poses and texture; the map is over it while the brush is on.
#[test]
fn a_gltf_file_is_opened_with_its_texture_and_its_animations() {
    let Some((server, folder)) = start("gltf") else { return };
    let mut tiny = Tiny::strip();
    let skin = image::RgbaImage::from_fn(64, 64, |x, y| {
        let alpha = if y < 32 { 255 } else { 0 };
        image::Rgba(if x < 32 { [255, 0, 0, alpha] } else { [0, 0, 255, alpha] })
    });
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

    // The colour that is clicked keeps its shape: it is seen while the brush is on.
    view.click("brush");
    view.click("colour");
    let red = shot.pixels.iter().position(|p| p[0] > 100 && p[2] < 60).expect("red") as u32;
    let at = [area[0] + red % shot.size[0] + 3, area[1] + red / shot.size[0] + 3];
    view.drag(&[at]);
    view.wait("paint", |event| event["tile"] == 1001);
    let edit = view.wait("solve", |event| event["purpose"] == "final")["edit"].clone();
    view.wait("drawn", |event| event["edit"] == edit && event["overlay"] == 1.0);
    view.move_away();
    let painted = server.shot().cut(area);
    let changed = painted.changes(&shot);
    let was_blue = |&&[x, y]: &&[u32; 2]| shot.pixels[(y * shot.size[0] + x) as usize][2] > 100;
    let share = changed.iter().filter(was_blue).count() as f64 / changed.len() as f64;
    assert!(changed.len() > 2000 && share < 0.1, "{share} of {} pixels were blue", changed.len());
    view.click("brush");
    view.wait("drawn", |event| event["overlay"] == 0.0);
    assert!(server.shot().cut(area).differing(&shot) < 1e-3, "the map stays over the texture");

    view.click("Animation");
    view.click("Animation short");
    let opened = view.wait("open", |_| true);
    assert_eq!(opened["poses"], 7);
    view.wait("drawn", |event| event["purpose"] == "final");
    view.quit();

    // Where the material has holes the surface is not there.
    tiny.json["materials"][0]["alphaMode"] = "MASK".into();
    std::fs::write(&path, tiny.glb()).expect("written");
    let mut view = Program::start(&server, &folder, &options);
    let (holed, _) = settled(&server, &mut view);
    view.quit();
    let coloured = |shot: &Shot| shot.pixels.iter().filter(|p| p[0].abs_diff(p[2]) > 60).count() as f64;
    let share = coloured(&holed) / coloured(&shot);
    // The farther half, which looks smaller.
    assert!((0.2..0.45).contains(&share), "{share} of the strip is there");
}
