//! Compiles kernels.

use std::sync::OnceLock;

use super::kernels::{Binding, Kernel, SOURCES, Source, slot};
use super::layout::{Chart, Params};
use vrtm_core::allocation::Vec;

/// A compiled kernel.
#[derive(Debug)]
pub struct Pipeline {
    pub pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
}

/// The compiled kernels of a device; each is compiled when it is first used.
#[derive(Debug, Default)]
pub struct Pipelines(OnceLock<Vec<OnceLock<Pipeline>>>);

impl Pipelines {
    /// The slot of a kernel's pipeline.
    pub fn place(&self, kernel: Kernel) -> &OnceLock<Pipeline> {
        &self.0.get_or_init(|| SOURCES.iter().map(|_| OnceLock::new()).collect())[kernel as usize]
    }
}

impl Pipeline {
    pub fn new(device: &wgpu::Device, source: &Source) -> Pipeline {
        let bytes = device.limits().max_compute_workgroup_storage_size;
        Pipeline::from_text(device, source, source.text(bytes))
    }

    /// Compiles `text` instead of the source's own text.
    pub(super) fn from_text(device: &wgpu::Device, source: &Source, text: String) -> Pipeline {
        let label = Some(source.entry);
        let entries: Vec<_> = source.bindings.iter().map(|&binding| layout_entry(binding)).collect();
        let layout =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(source.entry),
            // Zeroing is unnecessary: kernels write all workgroup memory before they read it.
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache: None,
        });
        Pipeline { pipeline, layout }
    }

    /// A bind group of a kernel, with the resources of its bindings in their order.
    pub fn bind_group<'a>(
        &self,
        device: &wgpu::Device,
        source: &Source,
        resources: impl IntoIterator<Item = wgpu::BindingResource<'a>>,
    ) -> wgpu::BindGroup {
        let Source { entry, bindings, .. } = source;
        let entry_of =
            |(binding, resource): (&Binding, _)| wgpu::BindGroupEntry { binding: binding.number(), resource };
        let entries: Vec<_> = bindings.iter().zip(resources).map(entry_of).collect();
        let (label, layout) = (Some(*entry), &self.layout);
        device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries })
    }
}

/// A range of a buffer's bytes.
pub fn range(buffer: &wgpu::Buffer, offset: u64, size: u64) -> wgpu::BindingResource<'_> {
    let size = std::num::NonZeroU64::new(size);
    wgpu::BindingResource::Buffer(wgpu::BufferBinding { buffer, offset, size })
}

fn layout_entry(binding: Binding) -> wgpu::BindGroupLayoutEntry {
    let ty = match binding {
        Binding::Params => wgpu::BufferBindingType::Uniform,
        Binding::Read(_) => wgpu::BufferBindingType::Storage { read_only: true },
        Binding::Write(_) => wgpu::BufferBindingType::Storage { read_only: false },
    };
    let size = match binding {
        Binding::Params => size_of::<Params>(),
        Binding::Write(slot::CHARTS) => size_of::<Chart>(),
        _ => 0,
    };
    wgpu::BindGroupLayoutEntry {
        binding: binding.number(),
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: binding == Binding::Params,
            min_binding_size: std::num::NonZeroU64::new(size as u64),
        },
        count: None,
    }
}
