//! Everything that is computed before drawing: the solved pose, and the tiles' textures as painted and as warped
//! beforehand.

use vrtm::DeviceSettings;

use super::camera::View;
use super::draw::{Maps, Renderer, Shot};
use super::gpu::Gpu;
use super::maps::Solved;
use super::model::Model;
use super::pipelines::Pipelines;
use super::surface::{self, Corner};
use super::texture::{self, Levels};
use super::ways::Way;
use super::{Result, reference};

pub struct Stage {
    pub positions: Vec<[f32; 3]>,
    pub solved: Solved,
    pub corners: Vec<Corner>,
    pub colours: Vec<Levels>,
    /// The colours to draw with the original UVs.
    pub warped: Vec<Levels>,
}

impl Stage {
    /// Solves a frame of a model (numbered from 1), and paints textures of `side` texels, a power of two.
    pub fn new(model: &Model, frame: usize, side: usize, settings: &DeviceSettings) -> Result<Stage> {
        let positions = model.frame(frame)?.to_vec();
        let solved = Solved::new(model, &positions, settings)?;
        let rigidity = |udim: &u32| model.tiles.iter().find(|tile| tile.udim == *udim);
        let tiles = solved.udims.iter().map(rigidity);
        let colours: Vec<Levels> = tiles.map(|tile| texture::colours(tile, side)).collect();
        let warp = |(tile, colours)| reference::warped(&solved, tile, colours);
        let warped = colours.iter().enumerate().map(warp).collect::<Result<_>>()?;
        let corners = surface::corners(&model.mesh.triangles(), &positions, &solved.udims);
        Ok(Stage { positions, solved, corners, colours, warped })
    }

    pub fn renderer<'a>(&self, gpu: &'a Gpu, size: [u32; 2]) -> Result<Renderer<'a>> {
        Renderer::new(gpu, &self.corners, size)
    }

    pub fn camera(&self, renderer: &Renderer, view: &View, size: [u32; 2]) -> wgpu::BindGroup {
        renderer.camera(&view.camera(&self.positions, size))
    }
}

/// A shot of a way.
pub fn shot<'a>(
    way: &Way,
    pipelines: &'a Pipelines,
    camera: &'a wgpu::BindGroup,
    material: &'a wgpu::BindGroup,
    maps: &'a Maps,
) -> Shot<'a> {
    Shot { pipelines, camera, material, map: maps.of(way) }
}

/// Milliseconds per frame of each shot: medians over rounds in which all shots take turns, so that noise affects all
/// alike. An additional first round is not counted.
pub fn medians(renderer: &Renderer, shots: &[Shot], rounds: usize, frames: u32) -> Result<Vec<f64>> {
    let mut times = vec![Vec::new(); shots.len()];
    for round in 0..=rounds {
        for (shot, times) in shots.iter().zip(&mut times) {
            let time = renderer.time(shot, frames)?;
            if round > 0 {
                times.push(time);
            }
        }
    }
    for times in &mut times {
        times.sort_by(f64::total_cmp);
    }
    Ok(times.iter().map(|times| times[times.len() / 2]).collect())
}
