//! A loop as in a viewport: solve, invert, draw. The maps go from vrtm to the renderer in memory of the GPU that both use;
//! or, to compare, through the CPU.

use std::time::Instant;

use vrtm::{AdapterId, Backend, DeviceSettings};
use vrtm_examples::mesh::Triangle;

use super::Result;
use super::camera::View;
use super::draw::{Renderer, Shot};
use super::gpu::Gpu;
use super::maps::Solved;
use super::model::Model;
use super::pipelines::Pipelines;
use super::shared::{SharedMaps, uuid};
use super::surface::corners;
use super::texture::Levels;
use super::ways::Way;

/// The way of the maps from vrtm to the renderer, as deltas in f16.
pub enum Transport {
    /// vrtm writes them to memory of the renderer's device.
    Shared(SharedMaps),
    /// They are fetched, and uploaded.
    Host,
}

/// Milliseconds of the parts of a frame, as the program waits for them.
#[derive(Clone, Copy, Default)]
pub struct Times {
    pub solve: f64,
    /// Inversion, and the way of the maps up to where the renderer's GPU copies them to a texture.
    pub map: f64,
    /// The mesh's corners, that copy, and the picture.
    pub draw: f64,
}

impl Times {
    pub fn frame(&self) -> f64 {
        self.solve + self.map + self.draw
    }
}

pub struct Live<'a> {
    gpu: &'a Gpu,
    triangles: Vec<Triangle>,
    solved: Solved,
    renderer: Renderer<'a>,
    camera: wgpu::BindGroup,
    material: wgpu::BindGroup,
    pipelines: Pipelines,
    side: u32,
    texture: wgpu::Texture,
    map: wgpu::BindGroup,
}

/// vrtm on the renderer's GPU.
pub fn settings(gpu: &Gpu) -> DeviceSettings {
    DeviceSettings {
        backend: Backend::Gpu,
        adapter_id: uuid(gpu).map(AdapterId::Uuid),
        ..DeviceSettings::default()
    }
}

impl<'a> Live<'a> {
    /// A model with textures of these colours, one for each tile of `solved`, drawn in pictures of `size` pixels through
    /// maps of `side` texels.
    pub fn new(
        gpu: &'a Gpu,
        model: &Model,
        solved: Solved,
        colours: &[Levels],
        view: &View,
        size: [u32; 2],
        side: u32,
    ) -> Result<Live<'a>> {
        let triangles = model.mesh.triangles();
        let renderer = Renderer::new(gpu, &corners(&triangles, &model.rest, &solved.udims), size)?;
        // Where the mesh may be, so that nothing of it is cut off.
        let reach: Vec<_> = model.rest.iter().chain(model.frames.iter().flatten()).copied().collect();
        let layers = solved.udims.len() as u32;
        gpu.check("--map", side, layers)?;
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("maps"),
            size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rg16Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        Ok(Live {
            camera: renderer.camera(&view.camera(&reach, size)),
            material: renderer.material(colours)?,
            pipelines: renderer.pipelines(&Way::named("forward-delta")),
            map: renderer.map(&texture),
            gpu,
            triangles,
            solved,
            renderer,
            side,
            texture,
        })
    }

    /// Memory of the renderer's device for the maps.
    pub fn shared(&self) -> Result<Transport> {
        SharedMaps::new(self.gpu, self.side, self.solved.udims.len() as u32).map(Transport::Shared)
    }

    /// Solves, inverts and draws a pose.
    pub fn frame(&mut self, positions: &[[f32; 3]], transport: &Transport) -> Result<Times> {
        let start = Instant::now();
        self.solved.solve(positions)?;
        let solved = Instant::now();
        let tiles = 0..self.solved.udims.len();
        let mut commands = Vec::new();
        match transport {
            Transport::Shared(maps) => {
                for tile in tiles {
                    // SAFETY: the image lies in memory of that size, and the last frame, which copied it, is done.
                    unsafe { self.solved.write_delta(tile, &maps.image(tile as u32)) }?;
                }
                commands = maps.copied_to(self.gpu, &self.texture);
            }
            Transport::Host => {
                for tile in tiles {
                    let texels = self.solved.half_delta(tile, self.side)?;
                    self.gpu.write(&self.texture, tile as u32, &texels);
                }
            }
        }
        let mapped = Instant::now();
        self.renderer.pose(&corners(&self.triangles, positions, &self.solved.udims));
        self.renderer.draw(commands, &self.shot())?;
        let drawn = Instant::now();
        let ms = |from: Instant, to: Instant| (to - from).as_secs_f64() * 1e3;
        Ok(Times { solve: ms(start, solved), map: ms(solved, mapped), draw: ms(mapped, drawn) })
    }

    /// The last frame's picture.
    pub fn picture(&self) -> Result<Vec<u8>> {
        self.renderer.picture(&self.shot())
    }

    fn shot(&self) -> Shot<'_> {
        Shot {
            pipelines: &self.pipelines,
            camera: &self.camera,
            material: &self.material,
            map: Some(&self.map),
        }
    }
}

/// A pose on the way from rest to the model's last frame and back, `n` steps of an eighth from rest on; never rest itself.
pub fn pose(model: &Model, n: usize) -> Vec<[f32; 3]> {
    let Some(last) = model.frames.last() else { return model.rest.clone() };
    let fraction = 1.0 - 0.125 * (n % 14).abs_diff(7) as f32;
    let between = |(p, r): (&[f32; 3], &[f32; 3])| [0, 1, 2].map(|k| r[k] + fraction * (p[k] - r[k]));
    last.iter().zip(&model.rest).map(between).collect()
}

/// The medians of frames.
pub fn medians(all: &[Times]) -> Times {
    let median = |of: fn(&Times) -> f64| {
        let mut values: Vec<f64> = all.iter().map(of).collect();
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    Times { solve: median(|t| t.solve), map: median(|t| t.map), draw: median(|t| t.draw) }
}
