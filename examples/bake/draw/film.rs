//! Draws a film: while the mesh turns once, it goes from rest to a pose, stays there, and goes back; on the left with
//! its own UVs, on the right with redirected ones.

use image::RgbImage;
use vrtm_examples::failure::{Failure, Result};
use vrtm_examples::source::Frame;
use vrtm_testkit::on_all_cores;

use super::camera::Camera;
use super::canvas::{Canvas, HEADING};
use super::stage::{INK, PAPER, SUPER, Stage, redirect};
use crate::bake::Bake;

/// Side of each half in pixels, and the height of its label.
const SIDE: usize = 400;
const LABEL: usize = 36;
/// Pictures at rest, on the way to the pose, and in it; as many lead back.
const AT_REST: usize = 6;
const ON_THE_WAY: usize = 14;
const IN_THE_POSE: usize = 26;
const COUNT: usize = AT_REST + 2 * ON_THE_WAY + IN_THE_POSE;
/// Duration of a picture, in seconds, as a fraction.
pub const DURATION: (u16, u16) = (2, 25);

/// Solves a frame and the way to it, and draws the pictures of the film.
pub fn draw(stage: &Stage, bake: &mut Bake, view: Option<[f64; 2]>, frame: &Frame) -> Result<Vec<RgbImage>> {
    let poses = [stage.rest.clone(), stage.near(&frame.positions)];
    let cameras = Camera::turning(&poses, view, COUNT);
    let mut pictures: Vec<RgbImage> = vec![RgbImage::default(); COUNT];
    for step in 0..=ON_THE_WAY + 1 {
        let way = smooth(step as f64 / (ON_THE_WAY + 1) as f64);
        let positions = stage.between(&frame.positions, way);
        let frame =
            Frame { positions, origin: frame.origin.clone(), note: String::new(), number: frame.number };
        bake.solve(&frame)?;
        let maps = bake.redirections().map_err(|e| Failure::named(&frame.origin, e))?;
        let pose = stage.near(&frame.positions);
        let numbers: Vec<usize> = (0..COUNT).filter(|&number| step_of(number) == step).collect();
        let drawn = on_all_cores(&numbers, |&number| {
            let size = [SIDE, SIDE - LABEL];
            let view = stage.view(&cameras[number], &pose, size);
            let mut canvas = Canvas::new([2 * SIDE, SIDE], PAPER);
            for (left, label) in [(0, "original UVs"), (SIDE, "redirected UVs")] {
                canvas.text([left + 14, 12], HEADING, INK, label);
                canvas.picture([left, LABEL], size, SUPER, |x, y| {
                    let sample = stage.sample(&view, x, y);
                    sample.map_or(PAPER, |s| {
                        let target = if left == 0 { s.uv } else { redirect(&maps[s.tile], s.uv) };
                        stage.painted(&view, &s, target)
                    })
                });
            }
            canvas.finish()
        });
        numbers.into_iter().zip(drawn).for_each(|(number, picture)| pictures[number] = picture);
    }
    Ok(pictures)
}

/// Step of a picture on the way from rest, 0, to the pose.
fn step_of(number: usize) -> usize {
    let from_end = COUNT - 1 - number;
    // The way back is the way there, so that each pose of it is solved once.
    let up = (number + 1).saturating_sub(AT_REST);
    up.min(from_end + 1).min(ON_THE_WAY + 1)
}

/// From 0 to 1, slowly at both ends.
fn smooth(t: f64) -> f64 {
    t * t * (3.0 - 2.0 * t)
}
