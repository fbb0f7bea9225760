//! The film of the example `render`: its left halves are the mesh with the original UVs, its right halves redirected,
//! frame by frame; and its textures come from files.

use std::path::{Path, PathBuf};

use image::{GenericImageView, Luma, Rgba, RgbaImage};
use vrtm::{Backend, DeviceSettings};

use vrtm_render::camera::View;
use vrtm_render::film::Film;
use vrtm_render::gpu::Gpu;
use vrtm_render::maps::Solved;
use vrtm_render::model::Model;
use vrtm_render::painted;
use vrtm_render::texture::{self, Levels};
use vrtm_testkit::has_gpu;

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("film").join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

fn open(model: &Model) -> Solved {
    Solved::open(model, &DeviceSettings { backend: Backend::Cpu, ..DeviceSettings::default() }).unwrap()
}

/// Both halves of a written picture.
fn halves(folder: &Path, frame: usize) -> [RgbaImage; 2] {
    let picture = image::open(folder.join(format!("film.{frame:04}.png"))).unwrap();
    let (width, height) = picture.dimensions();
    [0, width / 2].map(|x| picture.crop_imm(x, 0, width / 2, height).into_rgba8())
}

/// The mean difference of two pictures, of 255.
fn apart(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let sum: u64 = a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| u64::from(a.abs_diff(*b))).sum();
    sum as f64 / a.as_raw().len() as f64
}

#[test]
fn halves_differ_only_where_the_pose_stretches() {
    if !has_gpu() {
        return;
    }
    let gpu = Gpu::open(0).unwrap();
    let mut model = Model::scene("bulge").unwrap();
    // Rest, the pose, rest again: the last frame must not keep anything of the one before.
    model.frames = vec![model.rest.clone(), model.frames[0].clone(), model.rest.clone()];
    let solved = open(&model);
    let colours: Vec<Levels> = model.tiles.iter().map(|tile| texture::colours(Some(tile), 512)).collect();
    let view = View::of(&model.rest);
    let out = folder("bulge");
    let film =
        Film { gpu: &gpu, model: &model, colours: &colours, normals: None, view, size: [400, 200], map: 256 };
    film.draw(solved, 1..=3, &out).unwrap();
    let [rest, pose, again] = [1, 2, 3].map(|frame| halves(&out, frame));
    let [at_rest, posed] = [&rest, &pose].map(|[left, right]| apart(left, right));
    println!("halves apart at rest {at_rest:.3}, in the pose {posed:.3}");
    // At rest the map is the identity, up to the rounding of f32 and of the sampler's weights, which on hardware have
    // about 8 bits (an NVIDIA H100 gives 0.048); in the pose the discs' outlines are elsewhere, which is a small part
    // of a picture.
    let most = if gpu.software { 0.02 } else { 0.1 };
    assert!(at_rest < most, "{at_rest}");
    assert!(posed > 0.5, "{posed}");
    assert_eq!(rest, again);
    let error = film.draw(open(&model), 3..=4, &out).unwrap_err();
    assert_eq!(error, "--frame 4: bulge has frames 1 to 3");
}

#[test]
fn textures_come_from_files() {
    let folder = folder("painted");
    let pattern = |name: &str| folder.join(name).display().to_string();
    // Blue below, red above; a slope that rises to the right by a quarter of the tile over the whole of it.
    for udim in [1001, 1002] {
        let colour =
            RgbaImage::from_fn(
                8,
                8,
                |_, y| if y < 4 { Rgba([255, 0, 0, 255]) } else { Rgba([0, 0, 255, 0]) },
            );
        colour.save(folder.join(format!("colour.{udim}.png"))).unwrap();
    }
    let height = image::ImageBuffer::<Luma<u16>, _>::from_fn(64, 64, |x, _| Luma([(x * 1024) as u16]));
    height.save(folder.join("height.png")).unwrap();

    let colours = painted::colours("--colour", &pattern("colour.<UDIM>.png"), &[1001, 1002]).unwrap();
    assert_eq!(colours.len(), 2);
    // The first row is v = 0; the mean of both halves is half the light, and half of it metal.
    assert_eq!([colours[0][0][0], colours[0][0][63]], [[0, 0, 255, 0], [255, 0, 0, 255]]);
    assert_eq!(colours[0][3], [[188, 0, 188, 128]]);
    let normals = painted::normals("--height", &pattern("height.png"), &[1001], 0.25).unwrap();
    let [x, y, z, _] = normals[0][0][64 * 32 + 32];
    // A slope of a quarter turns the normal by atan(1/4) to the left; a step of 8 bits is 0.4 degrees there.
    let turned = (f64::from(x) - 127.5).atan2(f64::from(z) - 127.5).to_degrees();
    assert!((turned + 14.04).abs() < 0.4 && y == 128, "{turned} {y}");

    let said = |pattern: &str, udims: &[u32]| painted::colours("--colour", pattern, udims).unwrap_err();
    let one = said("skin.png", &[1001, 1002]);
    assert_eq!(one, "--colour skin.png: the mesh has 2 tiles: write <UDIM> for the tile's number");
    let none = said(&pattern("none.png"), &[1001]);
    assert!(none.starts_with("--colour ") && none.contains("none.png"), "{none}");
    RgbaImage::new(8, 4).save(folder.join("odd.png")).unwrap();
    let odd = said(&pattern("odd.png"), &[1001]);
    assert!(odd.ends_with("odd.png: 8x4 texels: not a power of two on each side"), "{odd}");
}
