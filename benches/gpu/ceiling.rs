//! Measures the greatest bandwidth that any kernel could reach: that of a copy, timed on the device if it has
//! timestamps, otherwise by the host's clock.

use std::time::Instant;

const COPY: &str = "
@group(0) @binding(0) var<storage, read> source: array<vec4f>;
@group(0) @binding(1) var<storage, read_write> target_: array<vec4f>;
@compute @workgroup_size(256)
fn copy(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) t: u32) {
    let at = (group.y * 65535u + group.x) * 256u + t;
    if at < arrayLength(&source) {
        target_[at] = source[at];
    }
}";

/// Copies per submission, and number of submissions.
const COPIES: u32 = 10;
const ROUNDS: usize = 5;

/// Bytes read and written per second: the highest value of several rounds.
pub fn bytes_per_second(adapter: usize) -> Result<f64, String> {
    let fail = |error: &dyn std::fmt::Display| format!("bandwidth: {error}");
    let backends = wgpu::Backends::VULKAN | wgpu::Backends::DX12 | wgpu::Backends::METAL;
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = backends;
    let instance = wgpu::Instance::new(descriptor);
    let all = pollster::block_on(instance.enumerate_adapters(backends));
    let names = vrtm::adapters();
    // The library lists hardware adapters first, so the same adapter is found by its name.
    let wanted = &names.get(adapter).ok_or("no such adapter")?.name;
    let adapter = all
        .into_iter()
        .find(|adapter| wanted.contains(&adapter.get_info().name))
        .ok_or("bandwidth: the adapter is gone")?;
    let limits = adapter.limits();
    let size = limits.max_storage_buffer_binding_size.min(1 << 30) / 16 * 16;
    let (device, queue) = pollster::block_on(
        adapter.request_device(&wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() }),
    )
    .map_err(|error| fail(&error))?;
    let buffer = || {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        })
    };
    let (source, target) = (buffer(), buffer());
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: None,
        source: wgpu::ShaderSource::Wgsl(COPY.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: None,
        layout: None,
        module: &module,
        entry_point: Some("copy"),
        compilation_options: Default::default(),
        cache: None,
    });
    let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: None,
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: source.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: target.as_entire_binding() },
        ],
    });
    let groups = (size / 16).div_ceil(256) as u32;
    let mut best = 0.0f64;
    for _ in 0..=ROUNDS {
        let mut encoder = device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &group, &[]);
        for _ in 0..COPIES {
            pass.dispatch_workgroups(groups.min(65535), groups.div_ceil(65535), 1);
        }
        drop(pass);
        let start = Instant::now();
        queue.submit([encoder.finish()]);
        device.poll(wgpu::PollType::wait_indefinitely()).map_err(|error| fail(&error))?;
        best = best.max((u64::from(COPIES) * 2 * size) as f64 / start.elapsed().as_secs_f64());
    }
    Ok(best)
}
