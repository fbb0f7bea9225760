//! The window's GPU, with the pipelines.

use eframe::egui_wgpu::RenderState;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Samples per pixel.
pub const SAMPLES: u32 = 4;
pub const COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
pub const METRIC: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Float;

/// The device, and what is made once.
pub struct Gpu {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub name: String,
    /// True if maps of 32-bit floats can be filtered; otherwise they have 16 bits.
    pub filterable: bool,
    pub view: wgpu::BindGroupLayout,
    pub tile: wgpu::BindGroupLayout,
    pub map: wgpu::BindGroupLayout,
    pub surface: wgpu::RenderPipeline,
    pub metric: wgpu::RenderPipeline,
    pub linear: wgpu::Sampler,
}

impl Gpu {
    pub fn new(state: &RenderState) -> Gpu {
        let device = state.device.clone();
        let info = state.adapter.get_info();
        let layout = |entries: &[wgpu::BindingType]| {
            let entry = |(binding, &ty): (u32, &wgpu::BindingType)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                ty,
                count: None,
            };
            let entries: Vec<_> = (0..).zip(entries).map(entry).collect();
            device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries })
        };
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        let texture = |filterable, view_dimension| wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Float { filterable },
            view_dimension,
            multisampled: false,
        };
        let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let storage = buffer(wgpu::BufferBindingType::Storage { read_only: true });
        let plain = wgpu::TextureViewDimension::D2;
        let view = layout(&[buffer(wgpu::BufferBindingType::Uniform), storage, storage, storage]);
        let places = wgpu::BindingType::Texture {
            sample_type: wgpu::TextureSampleType::Uint,
            view_dimension: plain,
            multisampled: false,
        };
        let filtered = texture(true, plain);
        let tile = layout(&[filtered, texture(false, plain), sampler, filtered, filtered, places]);
        let map = layout(&[texture(true, wgpu::TextureViewDimension::D2Array), sampler]);
        let parts = [
            include_str!("../../render/src/map_filtered.wgsl"),
            include_str!("../../render/src/redirect.wgsl"),
            include_str!("surface.wgsl"),
        ];
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("surface"),
            source: wgpu::ShaderSource::Wgsl(parts.join("\n").into()),
        });
        let corners = wgpu::VertexBufferLayout {
            array_stride: 12,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Uint32, 1 => Float32x2],
        };
        let corners = &[Some(corners)];
        let surface = pipeline(
            (&device, &module),
            ["corner", "surface"],
            (&[&view, &tile, &map], corners),
            COLOUR,
            true,
        );
        let metric =
            pipeline((&device, &module), ["flat_corner", "rest_metric"], (&[&view], corners), METRIC, false);
        let linear = device.create_sampler(&wgpu::SamplerDescriptor {
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            mipmap_filter: wgpu::MipmapFilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        Gpu {
            queue: state.queue.clone(),
            name: info.name,
            filterable: device.features().contains(wgpu::Features::FLOAT32_FILTERABLE),
            view,
            tile,
            map,
            surface,
            metric,
            linear,
            device,
        }
    }

    /// A buffer with this content.
    pub fn buffer(&self, contents: &[u8], usage: wgpu::BufferUsages) -> wgpu::Buffer {
        let usage = usage | wgpu::BufferUsages::COPY_DST;
        self.device.create_buffer_init(&BufferInitDescriptor { label: None, contents, usage })
    }

    /// A texture of one layer.
    pub fn texture(
        &self,
        [width, height]: [u32; 2],
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
        [levels, samples]: [u32; 2],
    ) -> wgpu::Texture {
        let srgb = format == wgpu::TextureFormat::Rgba8Unorm;
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: levels,
            sample_count: samples,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: if srgb { &[COLOUR] } else { &[] },
        })
    }

    /// A group of bindings.
    pub fn group(
        &self,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource],
    ) -> wgpu::BindGroup {
        let mut entries = Vec::new();
        for (binding, resource) in (0..).zip(resources) {
            entries.push(wgpu::BindGroupEntry { binding, resource: resource.clone() });
        }
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout, entries: &entries })
    }

    /// Writes texels to a part of a level of a texture; the rows are packed.
    pub fn write(&self, texture: &wgpu::Texture, level: u32, first: [u32; 2], size: [u32; 2], bytes: &[u8]) {
        let place = wgpu::TexelCopyTextureInfo {
            texture,
            mip_level: level,
            origin: wgpu::Origin3d { x: first[0], y: first[1], z: 0 },
            aspect: wgpu::TextureAspect::All,
        };
        let texel = texture.format().block_copy_size(None).unwrap_or(4);
        let rows = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(size[0] * texel),
            rows_per_image: None,
        };
        let part = wgpu::Extent3d { width: size[0], height: size[1], depth_or_array_layers: 1 };
        self.queue.write_texture(place, bytes, rows, part);
    }
}

fn pipeline(
    (device, module): (&wgpu::Device, &wgpu::ShaderModule),
    [vertex, fragment]: [&str; 2],
    (groups, buffers): (&[&wgpu::BindGroupLayout], &[Option<wgpu::VertexBufferLayout>]),
    format: wgpu::TextureFormat,
    on_screen: bool,
) -> wgpu::RenderPipeline {
    let groups: Vec<_> = groups.iter().map(|&group| Some(group)).collect();
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label: None,
        bind_group_layouts: &groups,
        immediate_size: 0,
    });
    // The picture itself stays opaque.
    let write_mask = if on_screen { wgpu::ColorWrites::COLOR } else { wgpu::ColorWrites::ALL };
    let options = wgpu::PipelineCompilationOptions { constants: &[("DELTA", 1.0)], ..Default::default() };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some(fragment),
        layout: Some(&layout),
        vertex: wgpu::VertexState {
            module,
            entry_point: Some(vertex),
            compilation_options: Default::default(),
            buffers,
        },
        primitive: wgpu::PrimitiveState::default(),
        depth_stencil: on_screen.then(|| wgpu::DepthStencilState {
            format: DEPTH,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState {
            count: if on_screen { SAMPLES } else { 1 },
            // Hair, lashes and lenses need no order.
            alpha_to_coverage_enabled: on_screen,
            ..wgpu::MultisampleState::default()
        },
        fragment: Some(wgpu::FragmentState {
            module,
            entry_point: Some(fragment),
            compilation_options: options,
            targets: &[Some(wgpu::ColorTargetState { format, blend: None, write_mask })],
        }),
        multiview_mask: None,
        cache: None,
    })
}
