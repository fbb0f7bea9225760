//! The film in which the mesh turns.

use std::fs::{self, File};
use std::io::BufReader;
use std::path::Path;

use image::codecs::png::PngDecoder;
use image::imageops::crop_imm;
use image::{AnimationDecoder, Frame, RgbaImage};

use crate::common::mug;

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
    let path = mug().0.join("turning.png");
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
}
