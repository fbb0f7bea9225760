//! The shaders combined for each way, and their bindings.

use super::gpu::Gpu;
use super::surface::Corner;
use super::ways::{Map, Way};

pub const COLOUR: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8UnormSrgb;
pub const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// UV, derivatives, normal and layer; see `deferred.wgsl`.
pub const SURFACE: [wgpu::TextureFormat; 3] =
    [wgpu::TextureFormat::Rg32Float, wgpu::TextureFormat::Rgba16Float, wgpu::TextureFormat::Rgba16Float];

/// The layouts of the bind groups, in the order of their numbers in the shaders.
pub struct Layouts {
    pub view: wgpu::BindGroupLayout,
    /// A texture that a sampler filters: the colours, or a map.
    pub filtered: wgpu::BindGroupLayout,
    /// A map whose texels are loaded.
    pub loaded: wgpu::BindGroupLayout,
    pub surface: wgpu::BindGroupLayout,
}

/// The pipelines of a way.
pub struct Pipelines {
    /// The pass over the mesh: to the picture, or to the buffers of a deferred way.
    pub mesh: wgpu::RenderPipeline,
    /// The pass over the screen of a deferred way.
    pub screen: Option<wgpu::RenderPipeline>,
    /// True if the map is bound with its sampler.
    pub filtered: bool,
}

impl Layouts {
    pub fn new(gpu: &Gpu) -> Layouts {
        let texture =
            |filterable: bool, view_dimension: wgpu::TextureViewDimension| wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float { filterable },
                view_dimension,
                multisampled: false,
            };
        let layers = |filterable| texture(filterable, wgpu::TextureViewDimension::D2Array);
        let plain = texture(false, wgpu::TextureViewDimension::D2);
        let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering);
        let uniform = wgpu::BindingType::Buffer {
            ty: wgpu::BufferBindingType::Uniform,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let group = |types: &[wgpu::BindingType]| {
            let entries = (0..).zip(types).map(|(binding, &ty)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                ty,
                count: None,
            });
            let entries: Vec<_> = entries.collect();
            let descriptor = wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries };
            gpu.device.create_bind_group_layout(&descriptor)
        };
        Layouts {
            view: group(&[uniform]),
            filtered: group(&[layers(true), sampler]),
            loaded: group(&[layers(false)]),
            surface: group(&[plain; 3]),
        }
    }

    /// The pipelines of a way.
    pub fn pipelines(&self, gpu: &Gpu, way: &Way) -> Pipelines {
        let by_hand = way.map == Map::AbsoluteByHand || way.map == Map::Absolute && !gpu.filterable;
        let redirected = |lookup: &str| format!("{lookup}\n{}", include_str!("redirect.wgsl"));
        let lookup = match way.map {
            Map::None => include_str!("map_none.wgsl").to_owned(),
            _ if by_hand => redirected(include_str!("map_loaded.wgsl")),
            Map::DeltaMips => redirected(include_str!("map_mips.wgsl")),
            _ => redirected(include_str!("map_filtered.wgsl")),
        };
        let last = if way.deferred { include_str!("deferred.wgsl") } else { include_str!("forward.wgsl") };
        let parts = [include_str!("view.wgsl"), include_str!("material.wgsl"), &lookup, last];
        let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some(way.name),
            source: wgpu::ShaderSource::Wgsl(parts.join("\n").into()),
        });
        let map = match way.map {
            Map::None => None,
            _ if by_hand => Some(&self.loaded),
            _ => Some(&self.filtered),
        };
        let flag = |name: &'static str, set: bool| (name, f64::from(u8::from(set)));
        let mut constants = vec![flag("EXPLICIT", way.explicit)];
        if way.map != Map::None {
            constants.push(flag("DELTA", matches!(way.map, Map::Delta | Map::DeltaMips)));
        }
        let pass = Pass { gpu, module: &module, constants: &constants };
        let groups = [Some(&self.view), Some(&self.filtered), map];
        if way.deferred {
            let screen = [groups[0], groups[1], groups[2], Some(&self.surface)];
            Pipelines {
                mesh: pass.pipeline(&groups[..1], "surface", &SURFACE, true),
                screen: Some(pass.pipeline(&screen, "deferred", &[COLOUR], false)),
                filtered: !by_hand,
            }
        } else {
            let mesh = pass.pipeline(&groups, "forward", &[COLOUR], true);
            Pipelines { mesh, screen: None, filtered: !by_hand }
        }
    }
}

struct Pass<'a> {
    gpu: &'a Gpu,
    module: &'a wgpu::ShaderModule,
    constants: &'a [(&'a str, f64)],
}

impl Pass<'_> {
    fn pipeline(
        &self,
        groups: &[Option<&wgpu::BindGroupLayout>],
        fragment: &str,
        targets: &[wgpu::TextureFormat],
        of_mesh: bool,
    ) -> wgpu::RenderPipeline {
        let device = &self.gpu.device;
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: groups,
            immediate_size: 0,
        });
        let options = wgpu::PipelineCompilationOptions { constants: self.constants, ..Default::default() };
        let targets: Vec<_> = targets.iter().map(|&format| Some(format.into())).collect();
        let corners = wgpu::VertexBufferLayout {
            array_stride: size_of::<Corner>() as u64,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x2, 3 => Uint32],
        };
        let buffers = if of_mesh { &[Some(corners)][..] } else { &[] };
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(fragment),
            layout: Some(&layout),
            vertex: wgpu::VertexState {
                module: self.module,
                entry_point: Some(if of_mesh { "corner" } else { "screen" }),
                compilation_options: options.clone(),
                buffers,
            },
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: of_mesh.then(|| wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Less),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: self.module,
                entry_point: Some(fragment),
                compilation_options: options,
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}
