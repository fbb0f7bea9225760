//! The film in which the mesh turns.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use image::codecs::png::PngDecoder;
use image::imageops::crop_imm;
use image::{AnimationDecoder, Frame, Rgb, RgbImage, RgbaImage};

use crate::common::{bake, folder, succeed, text};
use crate::palette::Palette;

/// Side of each half, and the height of its label.
const SIDE: u32 = 400;
const LABEL: u32 = 36;

fn pictures(path: &Path) -> Vec<Frame> {
    let decoder = PngDecoder::new(BufReader::new(File::open(path).expect("a film"))).expect("a PNG");
    decoder.apng().expect("a film").into_frames().collect_frames().expect("whole pictures")
}

/// Share of the pixels that differ.
fn apart(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let count =
        a.pixels().zip(b.pixels()).filter(|(a, b)| (0..3).any(|c| a.0[c].abs_diff(b.0[c]) > 8)).count();
    count as f64 / f64::from(a.width() * a.height())
}

fn halves(picture: &RgbaImage) -> [RgbaImage; 2] {
    [0, SIDE].map(|left| crop_imm(picture, left, LABEL, SIDE, SIDE - LABEL).to_image())
}

#[test]
fn the_mesh_turns_between_rest_and_its_worst_pose_and_nothing_jumps_or_is_cut_off() {
    let out = folder("film");
    succeed(&["--size", "64", "--frames", "5,1", "--no-sheet", "--out", text(&out)]);
    let path = out.join("turning.png");
    assert!(fs::metadata(&path).expect("a film").len() < 4_000_000);
    let frames = pictures(&path);
    let times: Vec<u32> = frames.iter().map(|frame| frame.delay().numer_denom_ms().0).collect();
    assert!(
        times.iter().all(|&time| time == 80) && (4000..6000).contains(&times.iter().sum::<u32>()),
        "{times:?}"
    );
    let all: Vec<&RgbaImage> = frames.iter().map(Frame::buffer).collect();

    let paper = all[0].get_pixel(0, SIDE - 1);
    for (number, picture) in all.iter().enumerate() {
        assert_eq!(picture.dimensions(), (2 * SIDE, SIDE));
        for half in halves(picture) {
            let (right, bottom) = (SIDE - 1, SIDE - LABEL - 1);
            let edges = (0..SIDE).flat_map(|x| [(x, 0), (x, bottom)]);
            let edges = edges.chain((0..=bottom).flat_map(|y| [(0, y), (right, y)]));
            assert!(edges.into_iter().all(|(x, y)| half.get_pixel(x, y) == paper), "{number} is cut off");
            assert!(half.pixels().filter(|pixel| *pixel != paper).count() > 20_000, "{number} shows little");
        }
    }
    // Both sides are one at rest, and apart in frame 5, which is strained more than frame 1.
    let sides = |number: usize| halves(all[number]);
    let [left, right] = sides(0);
    assert_eq!(apart(&left, &right), 0.0);
    let [left, right] = sides(all.len() / 2);
    assert!(apart(&left, &right) > 0.08, "{}", apart(&left, &right));
    // It turns at rest, too, and from the last picture to the first one as from any to the next.
    let steps: Vec<f64> = (0..all.len()).map(|k| apart(all[k], all[(k + 1) % all.len()])).collect();
    let (last, others) = steps.split_last().expect("pictures");
    assert!(steps.iter().all(|&step| step > 0.01), "{steps:?}");
    assert!(*last <= others.iter().fold(0.0, |a: f64, &b| a.max(b)), "{steps:?}");

    // One of somebody else is not replaced, and one of vrtm's is.
    succeed(&["--scene", "squash", "--size", "16", "--no-sheet", "--out", text(&out)]);
    fs::write(&path, "notes").expect("a file");
    let refused = bake(&["--scene", "squash", "--size", "16", "--no-sheet", "--out", text(&out)]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("turning.png"));
    assert_eq!(fs::read(&path).expect("a file"), b"notes");
}

#[test]
fn few_colours_stay_as_they_are_and_many_are_near() {
    let error = |picture: RgbImage| {
        let indexed = Palette::of(std::slice::from_ref(&picture)).index(std::slice::from_ref(&picture));
        assert!(indexed.palette.len() <= 3 * 256);
        let colours: Vec<&[u8]> = indexed.palette.chunks_exact(3).collect();
        let pixels = picture.pixels().zip(&indexed.pictures[0]);
        let apart = |(pixel, &index): (&Rgb<u8>, &u8)| {
            (0..3).map(|c| pixel.0[c].abs_diff(colours[usize::from(index)][c])).max().unwrap_or(0)
        };
        pixels.map(apart).max().expect("pixels")
    };
    assert_eq!(error(RgbImage::from_fn(40, 2, |x, y| Rgb([6 * x as u8, 200, 100 * y as u8]))), 0);
    // Shades of two colours, as those of a lit surface.
    let shade = |x: u32, colour: [u32; 3]| Rgb(colour.map(|c| (c * x / 255) as u8));
    let shades = RgbImage::from_fn(256, 2, |x, y| shade(x, [[40, 90, 160], [230, 180, 90]][y as usize]));
    assert!(error(shades) <= 4);
}
