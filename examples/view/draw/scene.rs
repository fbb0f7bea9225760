//! The open mesh on the GPU: corners, the pose, and for each tile its rigidity, its metric at rest and its redirection.

use std::sync::Arc;

use super::beyond::Beyond;
use super::camera::View;
use super::gpu::{COLOUR, Gpu, METRIC};
use super::levels::Levels;
use super::paint;
use crate::brush::canvas::{Canvas, Rect};
use crate::mesh::normals;
use crate::model::Model;
use crate::pictures::Pictures;
use crate::solve::answer::{Answer, Maps};

/// Texels per side in which the metric at rest is stored: of one tile, and at least.
const METRIC_SIDES: [u32; 2] = [1024, 256];

/// A mesh on the GPU.
pub struct Scene {
    corners: wgpu::Buffer,
    positions: wgpu::Buffer,
    normals: wgpu::Buffer,
    rest: wgpu::Buffer,
    pub tiles: Vec<Tile>,
    /// The surface beyond seams that continue, and the maps that show it.
    beyond: Option<Beyond>,
    filled: Vec<Canvas>,
}

/// A tile on the GPU.
pub struct Tile {
    page: usize,
    /// Its corners.
    range: std::ops::Range<u32>,
    levels: Levels,
    rigidity: wgpu::Texture,
    group: wgpu::BindGroup,
    map: wgpu::BindGroup,
    map_texture: wgpu::Texture,
    /// The last upload.
    shown: Option<Arc<Maps>>,
}

impl Scene {
    /// Textures reach so far over the seams.
    pub fn new(
        gpu: &Gpu,
        model: &Model,
        canvases: &[Canvas],
        pictures: &Pictures,
        reach: Option<f64>,
    ) -> vrtm::Result<Scene> {
        let beyond = reach.map(|reach| Beyond::new(model, canvases, reach)).transpose()?;
        let (mut pictures, mut filled) = (pictures.clone(), canvases.to_vec());
        if let Some(beyond) = &beyond {
            pictures.colours = beyond.textures(&pictures.colours, false)?;
            pictures.normals = beyond.textures(&pictures.normals, true)?;
            filled = beyond.canvases(canvases);
        }
        let mut bytes = Vec::with_capacity(model.triangles.len() * 36);
        for triangle in &model.triangles {
            for (vertex, uv) in triangle.vertices.iter().zip(triangle.uvs) {
                bytes.extend(vertex.to_ne_bytes());
                bytes.extend(uv.iter().flat_map(|&x| (x as f32).to_ne_bytes()));
            }
        }
        let corners = gpu.buffer(&bytes, wgpu::BufferUsages::VERTEX);
        let rest = &model.rest;
        let storage =
            |points: &[[f32; 3]]| gpu.buffer(bytemuck::cast_slice(points), wgpu::BufferUsages::STORAGE);
        let (positions, rest_buffer) = (storage(rest), storage(rest));
        let normals = storage(&normals(&model.triangles, rest));
        let mut scene =
            Scene { corners, positions, normals, rest: rest_buffer, tiles: Vec::new(), beyond, filled };
        // All tiles together take as much as a few: a character has a dozen.
        let side = (METRIC_SIDES[0] >> (model.tiles.len().max(1).ilog2() / 2)).max(METRIC_SIDES[1]);
        let view = scene.view(gpu, &View { range: side as f32, ..View::default() });
        // The layers of a page share what it shows.
        let textures = |page| -> vrtm::Result<_> {
            // One texel stands for none.
            let (size, places) = match &scene.beyond {
                Some(beyond) => beyond.map(page)?,
                None => ([1, 1], vec![[0, 0]]),
            };
            let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
            let map = gpu.texture(size, wgpu::TextureFormat::Rg16Uint, usage, [1, 1]);
            gpu.write(&map, 0, [0, 0], size, bytemuck::cast_slice(&places));
            let linear = wgpu::TextureFormat::Rgba8Unorm;
            let colours = paint::texture(gpu, pictures.colours[page].as_deref(), COLOUR);
            let normals = paint::texture(gpu, pictures.normals[page].as_deref(), linear);
            Ok([colours, normals, map].map(|texture| texture.create_view(&Default::default())))
        };
        let of_pages = (0..model.pages.len()).map(textures).collect::<vrtm::Result<Vec<_>>>()?;
        for tile in &model.tiles {
            let range = 3 * tile.range.start as u32..3 * tile.range.end as u32;
            let made = scene.tile(gpu, (&view, side), (tile.page, range), &of_pages[tile.page]);
            scene.tiles.push(made);
        }
        Ok(scene)
    }

    /// Reach of textures over seams, in UV.
    pub fn reach(&self) -> Option<f64> {
        self.beyond.as_ref().map(Beyond::reach)
    }

    fn tile(
        &self,
        gpu: &Gpu,
        (view, side): (&wgpu::BindGroup, u32),
        (page, range): (usize, std::ops::Range<u32>),
        textures: &[wgpu::TextureView; 3],
    ) -> Tile {
        let canvas = &self.filled[page];
        let levels = Levels::new(canvas);
        let bound = wgpu::TextureUsages::TEXTURE_BINDING;
        let upload = bound | wgpu::TextureUsages::COPY_DST;
        let count = levels.levels.len() as u32;
        let rigidity = gpu.texture(canvas.size, wgpu::TextureFormat::R8Unorm, upload, [count, 1]);
        for (number, level) in (0..).zip(&levels.levels) {
            gpu.write(&rigidity, number, [0, 0], level.size, &level.texels);
        }
        let drawn = bound | wgpu::TextureUsages::RENDER_ATTACHMENT;
        let metric = gpu.texture([side; 2], METRIC, drawn, [1, 1]).create_view(&Default::default());
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                color_attachments: &[Some(attachment(&metric, None, wgpu::Color::TRANSPARENT))],
                ..Default::default()
            });
            pass.set_pipeline(&gpu.metric);
            pass.set_bind_group(0, view, &[]);
            pass.set_vertex_buffer(0, self.corners.slice(..));
            pass.draw(range.clone(), 0..1);
        }
        gpu.queue.submit([encoder.finish()]);
        let of_map = rigidity.create_view(&Default::default());
        let of_rigidity = wgpu::BindingResource::TextureView(&of_map);
        let [colours, normals, places] = textures.each_ref().map(wgpu::BindingResource::TextureView);
        let metric = wgpu::BindingResource::TextureView(&metric);
        let sampler = wgpu::BindingResource::Sampler(&gpu.linear);
        let resources = [of_rigidity, metric, sampler, colours, normals, places];
        let group = gpu.group(&gpu.tile, &resources);
        let (map_texture, map) = map_of(gpu, &Maps::identity());
        Tile { page, range, levels, rigidity, group, map, map_texture, shown: None }
    }

    /// A view of the mesh, as bindings.
    pub fn view(&self, gpu: &Gpu, view: &View) -> wgpu::BindGroup {
        let uniform = gpu.buffer(bytemuck::bytes_of(view), wgpu::BufferUsages::UNIFORM);
        let buffers = [&uniform, &self.positions, &self.normals, &self.rest];
        gpu.group(&gpu.view, &buffers.map(wgpu::Buffer::as_entire_binding))
    }

    /// Shows a result.
    pub fn show(&mut self, gpu: &Gpu, answer: &Answer) {
        for (buffer, points) in [(&self.positions, &answer.positions), (&self.normals, &answer.normals)] {
            gpu.queue.write_buffer(buffer, 0, bytemuck::cast_slice(points));
        }
        for (tile, solved) in self.tiles.iter_mut().zip(&answer.tiles) {
            if !tile.shown.as_ref().is_some_and(|shown| Arc::ptr_eq(shown, &solved.maps)) {
                let [width, height] = solved.maps.size;
                if [tile.map_texture.width(), tile.map_texture.height()] == [width, height] {
                    write_map(gpu, &tile.map_texture, &solved.maps);
                } else {
                    (tile.map_texture, tile.map) = map_of(gpu, &solved.maps);
                }
                tile.shown = Some(solved.maps.clone());
            }
        }
    }

    /// Follows a stroke.
    pub fn paint(&mut self, gpu: &Gpu, canvases: &[Canvas], page: usize, rect: Rect) {
        let changed = match &self.beyond {
            Some(beyond) => beyond.follow(&mut self.filled, canvases, page, rect),
            None => {
                self.filled[page].paste(rect, &canvases[page].copy(rect));
                vec![(page, rect)]
            }
        };
        for (page, rect) in changed {
            for tile in self.tiles.iter_mut().filter(|tile| tile.page == page) {
                for (level, (rect, texels)) in (0..).zip(tile.levels.update(&self.filled[page], rect)) {
                    gpu.write(&tile.rigidity, level, rect.first, rect.size, &texels);
                }
            }
        }
    }

    /// Draws all tiles.
    pub fn draw(&self, gpu: &Gpu, pass: &mut wgpu::RenderPass, view: &wgpu::BindGroup) {
        pass.set_pipeline(&gpu.surface);
        pass.set_bind_group(0, view, &[]);
        pass.set_vertex_buffer(0, self.corners.slice(..));
        for tile in &self.tiles {
            pass.set_bind_group(1, &tile.group, &[]);
            pass.set_bind_group(2, &tile.map, &[]);
            pass.draw(tile.range.clone(), 0..1);
        }
    }
}

/// A colour attachment that begins with one colour.
pub fn attachment<'a>(
    view: &'a wgpu::TextureView,
    resolve_target: Option<&'a wgpu::TextureView>,
    clear: wgpu::Color,
) -> wgpu::RenderPassColorAttachment<'a> {
    let store = if resolve_target.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store };
    let ops = wgpu::Operations { load: wgpu::LoadOp::Clear(clear), store };
    wgpu::RenderPassColorAttachment { view, depth_slice: None, resolve_target, ops }
}

fn map_of(gpu: &Gpu, maps: &Maps) -> (wgpu::Texture, wgpu::BindGroup) {
    let format = if gpu.filterable { wgpu::TextureFormat::Rg32Float } else { wgpu::TextureFormat::Rg16Float };
    let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
    let texture = gpu.texture(maps.size, format, usage, [1, 1]);
    write_map(gpu, &texture, maps);
    let view = texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..Default::default()
    });
    let resources = [wgpu::BindingResource::TextureView(&view), wgpu::BindingResource::Sampler(&gpu.linear)];
    let group = gpu.group(&gpu.map, &resources);
    (texture, group)
}

fn write_map(gpu: &Gpu, texture: &wgpu::Texture, maps: &Maps) {
    if gpu.filterable {
        gpu.write(texture, 0, [0, 0], maps.size, bytemuck::cast_slice(&maps.delta));
    } else {
        // A delta needs no more than 16 bits.
        let halves: Vec<u16> =
            maps.delta.iter().flatten().map(|&x| half::f16::from_f32(x).to_bits()).collect();
        gpu.write(texture, 0, [0, 0], maps.size, bytemuck::cast_slice(&halves));
    }
}
