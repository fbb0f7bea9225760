//! A picture of the mesh in one pane or two: drawn to a texture, and read back to be saved.

use super::camera::View;
use super::gpu::{COLOUR, DEPTH, Gpu, SAMPLES};
use super::scene::{Scene, attachment};

/// Behind the mesh: the same as in the window.
const BACKGROUND: wgpu::Color = wgpu::Color { r: 0.0085, g: 0.0095, b: 0.0115, a: 1.0 };

/// The column at which a wipe changes from one view to the other; both are seen.
pub fn line(width: u32, part: f32) -> u32 {
    ((width as f32 * part).round() as u32).clamp(1.min(width - 1), (width - 1).max(1))
}

/// A texture to draw to, with what drawing needs.
pub struct Picture {
    pub size: [u32; 2],
    pub texture: wgpu::Texture,
    resolved: wgpu::TextureView,
    samples: wgpu::TextureView,
    depth: wgpu::TextureView,
}

impl Picture {
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Picture {
        let most = gpu.device.limits().max_texture_dimension_2d;
        let size = size.map(|side| side.clamp(1, most));
        let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let kept = drawn | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        // The window reads encoded values; drawing encodes them.
        let texture = gpu.texture(size, wgpu::TextureFormat::Rgba8Unorm, kept, [1, 1]);
        let resolved =
            texture.create_view(&wgpu::TextureViewDescriptor { format: Some(COLOUR), ..Default::default() });
        let target = |format| gpu.texture(size, format, drawn, [1, SAMPLES]).create_view(&Default::default());
        Picture { size, texture, resolved, samples: target(COLOUR), depth: target(DEPTH) }
    }

    /// For each of several views, where it begins and its width, and the part of that which is seen: side by side, or
    /// one over the other, of which a line shows the first on its left.
    fn panes(&self, count: u32, wipe: Option<f32>) -> impl Iterator<Item = [[u32; 2]; 2]> {
        let all = self.size[0];
        let width = all / count;
        (0..count).map(move |k| match wipe.map(|part| line(all, part)) {
            None => [[k * width, width]; 2],
            Some(line) if k == 0 => [[0, all], [0, line]],
            Some(line) => [[0, all], [line, all - line]],
        })
    }

    /// Draws the mesh in each view, side by side, or with a wipe at this part of the width.
    pub fn draw(&self, gpu: &Gpu, scene: Option<&Scene>, views: &[View], wipe: Option<f32>) {
        let groups: Vec<_> =
            scene.iter().flat_map(|scene| views.iter().map(|view| scene.view(gpu, view))).collect();
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(attachment(&self.samples, Some(&self.resolved), BACKGROUND))],
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
            if let Some(scene) = scene {
                for ([[x, width], [from, seen]], group) in self.panes(groups.len() as u32, wipe).zip(&groups)
                {
                    let height = self.size[1];
                    pass.set_viewport(x as f32, 0.0, width as f32, height as f32, 0.0, 1.0);
                    pass.set_scissor_rect(from, 0, seen, height);
                    scene.draw(gpu, &mut pass, group);
                }
            }
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Reads the picture, 4 bytes per pixel.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<u8>, String> {
        let [width, height] = self.size;
        let row = (width * 4).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(row) * u64::from(height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_texture_to_buffer(
            self.texture.as_image_copy(),
            wgpu::TexelCopyBufferInfo {
                buffer: &buffer,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(row),
                    rows_per_image: None,
                },
            },
            wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        );
        gpu.queue.submit([encoder.finish()]);
        buffer.map_async(wgpu::MapMode::Read, .., |_| {});
        let failed = |error: &dyn std::fmt::Display| format!("{}: {error}", gpu.name);
        gpu.device
            .poll(wgpu::PollType::Wait { submission_index: None, timeout: None })
            .map_err(|error| failed(&error))?;
        let bytes = buffer.get_mapped_range(..).map_err(|error| failed(&error))?;
        Ok(bytes.chunks_exact(row as usize).flat_map(|line| &line[..width as usize * 4]).copied().collect())
    }
}
