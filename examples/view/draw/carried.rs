//! Studs and spikes on the GPU.

use std::f32::consts::TAU;

use bytemuck::{Pod, Zeroable};

use super::gpu::{COLOUR, Gpu, Pipe};
use crate::carry::Shape;
use crate::carry::ride::Placed;

/// Corners around.
const AROUND: u32 = 20;

/// A corner of the mesh that is drawn for each piece: its radius is 1 at the outline of the feature.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Corner {
    point: [f32; 3],
    normal: [f32; 3],
    /// The fourth is how it shines.
    colour: [f32; 4],
}

/// Geometry on the features of the open mesh.
pub struct Pieces {
    meshes: [wgpu::Buffer; Shape::ALL.len()],
    placed: Option<wgpu::Buffer>,
    count: u32,
}

/// A shape's outline: distances from its axis with heights and the normal there, from the skin to the tip. A painted
/// rim is left to be seen around it, and it begins under the skin, which is curved.
fn outline(shape: Shape) -> Vec<[[f32; 2]; 2]> {
    let arc = |k: usize, most: usize| (0.25 * TAU * k as f32 / most as f32).sin_cos();
    match shape {
        // A low dome on a straight wall.
        Shape::Studs => {
            let wall = [[[0.76, -0.30], [1.0, 0.0]], [[0.76, 0.06], [1.0, 0.0]]];
            let dome = (0..=6).map(|k| {
                let (sin, cos) = arc(k, 6);
                [[0.72 * cos, 0.10 + 0.34 * sin], [0.45 * cos, sin]]
            });
            wall.into_iter().chain(dome).collect()
        }
        // It is broad at its foot.
        Shape::Spikes => (0..=7)
            .map(|k| {
                let t = k as f32 / 7.0;
                [[0.74 * (1.0 - t).powf(1.4), 2.5 * t - 0.15], [1.0, 0.3 + 0.25 * (1.0 - t)]]
            })
            .collect(),
    }
}

/// Triangles around the axis.
fn mesh(shape: Shape) -> Vec<Corner> {
    let outline = outline(shape);
    let corner = |k: u32, step: usize| {
        let [[radius, height], [out, up]] = outline[step];
        let (sin, cos) = (k as f32 / AROUND as f32 * TAU).sin_cos();
        let t = step as f32 / (outline.len() - 1) as f32;
        let colour = match shape {
            Shape::Studs => [0.30, 0.33, 0.38, 0.45],
            // Horn, which is lighter at its tip.
            Shape::Spikes => {
                let [r, g, b] = [0, 1, 2].map(|c| [0.30, 0.17, 0.09][c] + t * [0.50, 0.54, 0.46][c]);
                [r, g, b, 0.22]
            }
        };
        Corner { point: [radius * cos, radius * sin, height], normal: [out * cos, out * sin, up], colour }
    };
    let quad = |(k, step): (u32, usize)| {
        let [a, b, c, d] = [(k, step), (k + 1, step), (k + 1, step + 1), (k, step + 1)];
        [a, b, c, a, c, d].map(|(k, step)| corner(k, step))
    };
    let quads = (0..AROUND).flat_map(|k| (0..outline.len() - 1).map(move |step| (k, step)));
    quads.flat_map(quad).collect()
}

/// The pipeline that draws them.
pub fn pipeline(pipe: &Pipe, view: &wgpu::BindGroupLayout) -> wgpu::RenderPipeline {
    let corners = wgpu::VertexBufferLayout {
        array_stride: size_of::<Corner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x4],
    };
    let pieces = wgpu::VertexBufferLayout {
        array_stride: size_of::<Placed>() as u64,
        step_mode: wgpu::VertexStepMode::Instance,
        attributes: &wgpu::vertex_attr_array![
            3 => Float32x3, 4 => Float32x3, 5 => Float32x3, 6 => Float32x3,
            7 => Float32x3, 8 => Float32x3, 9 => Float32x3, 10 => Float32x3
        ],
    };
    pipe.pipeline(["carried_corner", "carried"], (&[view], &[Some(corners), Some(pieces)]), COLOUR, true, "")
}

impl Pieces {
    pub fn new(gpu: &Gpu) -> Pieces {
        let buffer = |(_, shape)| gpu.buffer(bytemuck::cast_slice(&mesh(shape)), wgpu::BufferUsages::VERTEX);
        Pieces { meshes: Shape::ALL.map(buffer), placed: None, count: 0 }
    }

    pub fn place(&mut self, gpu: &Gpu, placed: &[Placed]) {
        let bytes = bytemuck::cast_slice(placed);
        match &self.placed {
            Some(buffer) if buffer.size() == bytes.len() as u64 => gpu.queue.write_buffer(buffer, 0, bytes),
            _ => self.placed = Some(gpu.buffer(bytes, wgpu::BufferUsages::VERTEX)),
        }
        self.count = placed.len() as u32;
    }

    /// Draws them after the surface, whose view is bound.
    pub fn draw(&self, gpu: &Gpu, pass: &mut wgpu::RenderPass, shape: Shape) {
        let (Some(placed), 1..) = (&self.placed, self.count) else { return };
        let mesh = &self.meshes[shape as usize];
        pass.set_pipeline(&gpu.carried);
        pass.set_vertex_buffer(0, mesh.slice(..));
        pass.set_vertex_buffer(1, placed.slice(..));
        pass.draw(0..(mesh.size() / size_of::<Corner>() as u64) as u32, 0..self.count);
    }
}
