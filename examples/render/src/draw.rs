//! Draws a mesh in one of the ways, reads the picture back, and measures the time of frames.

use std::time::Instant;

use super::Result;
use super::camera::Camera;
use super::gpu::{Gpu, Layers};
use super::maps::Solved;
use super::pipelines::{COLOUR, DEPTH, Layouts, Pipelines, SURFACE};
use super::surface::Corner;
use super::texture::Levels;
use super::ways::{Map, Way};

/// A mesh on a GPU, and the pictures that it is drawn to.
pub struct Renderer<'a> {
    gpu: &'a Gpu,
    layouts: Layouts,
    corners: wgpu::Buffer,
    corner_count: u32,
    size: [u32; 2],
    colour: wgpu::Texture,
    depth: wgpu::TextureView,
    surface: Vec<wgpu::TextureView>,
    surface_group: wgpu::BindGroup,
}

/// The maps of one size.
pub struct Maps {
    filtered: Option<wgpu::BindGroup>,
    loaded: wgpu::BindGroup,
    delta: wgpu::BindGroup,
}

/// The contents of a frame.
#[derive(Clone, Copy)]
pub struct Shot<'a> {
    pub pipelines: &'a Pipelines,
    pub camera: &'a wgpu::BindGroup,
    pub material: &'a wgpu::BindGroup,
    /// The map's group, unless the original UVs are used.
    pub map: Option<&'a wgpu::BindGroup>,
}

impl<'a> Renderer<'a> {
    /// # Errors
    /// The size of the picture if the GPU does not support it.
    pub fn new(gpu: &'a Gpu, corners: &[Corner], size: [u32; 2]) -> Result<Renderer<'a>> {
        let most = gpu.device.limits().max_texture_dimension_2d;
        if size.iter().any(|&side| side == 0 || side > most) {
            return Err(format!("--size {}x{}: sides are 1 to {most} on {}", size[0], size[1], gpu.name));
        }
        let layouts = Layouts::new(gpu);
        let read = wgpu::TextureUsages::TEXTURE_BINDING;
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let surface: Vec<_> = SURFACE.map(|format| view(&gpu.target(size, format, read))).into();
        let textures: Vec<_> = surface.iter().map(wgpu::BindingResource::TextureView).collect();
        let surface_group = group(gpu, &layouts.surface, &textures);
        Ok(Renderer {
            gpu,
            corners: vertices(gpu, corners),
            corner_count: corners.len() as u32,
            size,
            colour: gpu.target(size, COLOUR, wgpu::TextureUsages::COPY_SRC),
            depth: view(&gpu.target(size, DEPTH, wgpu::TextureUsages::empty())),
            surface,
            surface_group,
            layouts,
        })
    }

    /// Draws another pose from now on.
    pub fn pose(&mut self, corners: &[Corner]) {
        self.corners = vertices(self.gpu, corners);
        self.corner_count = corners.len() as u32;
    }

    pub fn pipelines(&self, way: &Way) -> Pipelines {
        self.layouts.pipelines(self.gpu, way)
    }

    pub fn camera(&self, camera: &Camera) -> wgpu::BindGroup {
        let buffer = self.gpu.buffer(bytemuck::bytes_of(camera), wgpu::BufferUsages::UNIFORM);
        group(self.gpu, &self.layouts.view, &[buffer.as_entire_binding()])
    }

    /// Uploads the tiles' colours.
    pub fn material(&self, colours: &[Levels]) -> Result<wgpu::BindGroup> {
        let (format, side) = (wgpu::TextureFormat::Rgba8UnormSrgb, colours[0][0].len().isqrt() as u32);
        let layers = Layers { format, side, layers: colours.iter().map(bytes_of).collect() };
        let colours = self.gpu.upload("--texture", &layers)?;
        let sampler = self.sampler(self.gpu.anisotropy());
        let entries =
            [wgpu::BindingResource::TextureView(&colours), wgpu::BindingResource::Sampler(&sampler)];
        Ok(group(self.gpu, &self.layouts.filtered, &entries))
    }

    /// Uploads the maps of all tiles at a size.
    pub fn maps(&self, solved: &Solved, side: u32) -> Result<Maps> {
        let tiles = 0..solved.udims.len();
        let texels = tiles.clone().map(|tile| solved.absolute(tile, side)).collect::<Result<Vec<_>>>()?;
        let layers = texels.iter().map(|texels| vec![bytemuck::cast_slice(texels)]).collect();
        let format = wgpu::TextureFormat::Rg32Float;
        let absolute = self.gpu.upload("--map", &Layers { format, side, layers })?;
        drop(texels);
        let levels = tiles.map(|tile| solved.delta(tile, side)).collect::<Result<Vec<_>>>()?;
        let layers = levels.iter().map(|levels| levels.iter().map(|l| bytemuck::cast_slice(l)).collect());
        let format = wgpu::TextureFormat::Rg16Float;
        let delta = self.gpu.upload("--map", &Layers { format, side, layers: layers.collect() })?;
        // Without anisotropy, which has no effect on a map without coarser levels.
        let sampler = self.sampler(1);
        let filtered = |view| {
            let entries =
                [wgpu::BindingResource::TextureView(view), wgpu::BindingResource::Sampler(&sampler)];
            group(self.gpu, &self.layouts.filtered, &entries)
        };
        Ok(Maps {
            filtered: self.gpu.filterable.then(|| filtered(&absolute)),
            loaded: group(self.gpu, &self.layouts.loaded, &[wgpu::BindingResource::TextureView(&absolute)]),
            delta: filtered(&delta),
        })
    }

    /// Linear within and between levels, clamped to the edge.
    fn sampler(&self, anisotropy_clamp: u16) -> wgpu::Sampler {
        self.gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            anisotropy_clamp,
            ..Default::default()
        })
    }

    /// The group of a texture with deltas in f16, one layer for each tile.
    pub fn map(&self, texture: &wgpu::Texture) -> wgpu::BindGroup {
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..Default::default()
        });
        let sampler = self.sampler(1);
        let entries = [wgpu::BindingResource::TextureView(&view), wgpu::BindingResource::Sampler(&sampler)];
        group(self.gpu, &self.layouts.filtered, &entries)
    }

    /// Draws a frame once other commands are done, and waits for it.
    pub fn draw(&self, mut commands: Vec<wgpu::CommandBuffer>, shot: &Shot) -> Result<()> {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.record(&mut encoder, shot);
        commands.push(encoder.finish());
        self.gpu.queue.submit(commands);
        self.gpu.wait()
    }

    /// Draws a frame and reads it: RGBA, first row at the top, alpha 255 where the mesh is.
    pub fn picture(&self, shot: &Shot) -> Result<Vec<u8>> {
        let [width, height] = self.size;
        let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(row) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        self.record(&mut encoder, shot);
        let layout =
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        encoder.copy_texture_to_buffer(
            self.colour.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &buffer, layout },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        self.gpu.queue.submit([encoder.finish()]);
        let bytes = self.gpu.read(&buffer)?;
        Ok(bytes.chunks_exact(row as usize).flat_map(|bytes| &bytes[..4 * width as usize]).copied().collect())
    }

    /// Milliseconds per frame over some frames of one submission, from that to completion.
    pub fn time(&self, shot: &Shot, frames: u32) -> Result<f64> {
        let mut encoder = self.gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for _ in 0..frames {
            self.record(&mut encoder, shot);
        }
        let commands = encoder.finish();
        let start = Instant::now();
        self.gpu.queue.submit([commands]);
        self.gpu.wait()?;
        Ok(start.elapsed().as_secs_f64() * 1e3 / f64::from(frames))
    }

    /// Records a frame's passes.
    fn record(&self, encoder: &mut wgpu::CommandEncoder, shot: &Shot) {
        let pipelines = shot.pipelines;
        let picture = self.colour.create_view(&wgpu::TextureViewDescriptor::default());
        let alone = pipelines.screen.is_none();
        let mesh_targets: Vec<_> =
            if alone { vec![attachment(&picture)] } else { self.surface.iter().map(attachment).collect() };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &mesh_targets,
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Discard,
                }),
                stencil_ops: None,
            }),
            ..Default::default()
        });
        pass.set_pipeline(&pipelines.mesh);
        pass.set_bind_group(0, shot.camera, &[]);
        if alone {
            pass.set_bind_group(1, shot.material, &[]);
            if let Some(map) = shot.map {
                pass.set_bind_group(2, map, &[]);
            }
        }
        pass.set_vertex_buffer(0, self.corners.slice(..));
        pass.draw(0..self.corner_count, 0..1);
        drop(pass);
        let Some(screen) = &pipelines.screen else { return };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[attachment(&picture)],
            ..Default::default()
        });
        pass.set_pipeline(screen);
        pass.set_bind_group(0, shot.camera, &[]);
        pass.set_bind_group(1, shot.material, &[]);
        if let Some(map) = shot.map {
            pass.set_bind_group(2, map, &[]);
        }
        pass.set_bind_group(3, &self.surface_group, &[]);
        pass.draw(0..3, 0..1);
    }
}

impl Maps {
    /// The map's bind group for a way.
    pub fn of(&self, way: &Way) -> Option<&wgpu::BindGroup> {
        match way.map {
            Map::None => None,
            Map::Absolute => Some(self.filtered.as_ref().unwrap_or(&self.loaded)),
            Map::AbsoluteByHand => Some(&self.loaded),
            Map::Delta | Map::DeltaMips => Some(&self.delta),
        }
    }
}

fn vertices(gpu: &Gpu, corners: &[Corner]) -> wgpu::Buffer {
    gpu.buffer(bytemuck::cast_slice(corners), wgpu::BufferUsages::VERTEX)
}

fn bytes_of(levels: &Levels) -> Vec<&[u8]> {
    levels.iter().map(|level| level.as_flattened()).collect()
}

fn attachment(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load: wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
            store: wgpu::StoreOp::Store,
        },
    })
}

fn group(gpu: &Gpu, layout: &wgpu::BindGroupLayout, resources: &[wgpu::BindingResource]) -> wgpu::BindGroup {
    let entries = (0..)
        .zip(resources)
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource: resource.clone() });
    let entries: Vec<_> = entries.collect();
    gpu.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
}
