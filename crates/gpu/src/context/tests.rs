//! The errors of an open GPU. If no adapter is found, these tests print that they are skipped and pass, unless
//! VRTM_REQUIRE_GPU=1.

use wgpu::BufferUsages;

use super::*;
use crate::adapters;
use crate::kernels::Binding;
use crate::pipelines::range;
use vrtm_core::allocation::Vec;
use vrtm_core::backend::Gpu;

/// The first GPU, hardware or software.
pub fn gpu(options: Options) -> Option<Context> {
    let (usable, rejected) = adapters::all();
    let Some(adapter) = usable.first() else {
        let required = std::env::var_os("VRTM_REQUIRE_GPU").is_some_and(|value| value == "1");
        assert!(!required, "VRTM_REQUIRE_GPU is set, but there is no GPU adapter: {rejected:?}");
        println!("skipped: no GPU adapter");
        return None;
    };
    Some(Context::open(adapter, options).unwrap())
}

const STORAGE: BufferUsages =
    BufferUsages::STORAGE.union(BufferUsages::COPY_SRC).union(BufferUsages::COPY_DST);

/// Runs an entry point that reads binding 20 and writes binding 21, and returns `bytes` bytes of the latter.
pub fn computed<T: bytemuck::Pod>(
    context: &Context,
    text: String,
    entry: &'static str,
    input: &[u8],
    bytes: u64,
    workgroups: usize,
) -> std::vec::Vec<T> {
    let device = &context.device;
    let mut source = Kernel::Decide.source().clone();
    (source.entry, source.bindings) = (entry, &[Binding::Read(20), Binding::Write(21)]);
    let pipeline = Pipeline::from_text(device, &source, text);
    let given = context.filled("input", input, STORAGE).unwrap();
    let output = context.buffer("output", bytes, STORAGE).unwrap();
    // Buffers may be larger than requested; shaders derive counts from the sizes of the bindings.
    let resources = [range(&given, 0, input.len() as u64), range(&output, 0, bytes)];
    let group = pipeline.bind_group(device, &source, resources);
    let mut encoder = device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    pass.set_pipeline(&pipeline.pipeline);
    pass.set_bind_group(0, &group, &[]);
    pass.dispatch_workgroups(workgroups as u32, 1, 1);
    drop(pass);
    context.submit([encoder]).unwrap();
    bytemuck::pod_collect_to_vec(&context.read(&output, 0..bytes).unwrap())
}

/// A buffer with the content `bytes`.
fn filled(gpu: &Context, bytes: &[u8]) -> Result<wgpu::Buffer> {
    let buffer = gpu.buffer("numbers", bytes.len() as u64, STORAGE)?;
    gpu.queue.write_buffer(&buffer, 0, bytes);
    gpu.check().map(|()| buffer)
}

#[test]
fn bytes_go_there_and_back() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let bytes: Vec<u8> = (0..1000u32).flat_map(u32::to_ne_bytes).collect();
    let buffer = filled(&gpu, &bytes).unwrap();
    assert_eq!(gpu.read(&buffer, 0..4000).unwrap(), bytes);
    gpu.queue.write_buffer(&buffer, 8, &[7; 4]);
    assert_eq!(gpu.read(&buffer, 4..16).unwrap(), [1, 0, 0, 0, 7, 7, 7, 7, 3, 0, 0, 0]);
    assert!(gpu.read(&buffer, 4..4).unwrap().is_empty());
    // New buffers are zero.
    let buffer = gpu.buffer("zeros", 20, STORAGE).unwrap();
    assert_eq!(gpu.read(&buffer, 0..20).unwrap(), [0; 20]);
}

#[test]
fn a_wrong_call_is_an_internal_error_once() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let buffer = gpu.buffer("small", 16, STORAGE).unwrap();
    let error = gpu.read(&buffer, 0..64).unwrap_err();
    assert_eq!(error.kind, ErrorKind::Internal);
    assert!(error.message.starts_with("the GPU: ") && !error.message.contains('\n'), "{error}");
    // After a failed read its staging buffer can be used again, and so can the context.
    gpu.check().unwrap();
    assert_eq!(gpu.read(&buffer, 0..16).unwrap(), [0; 16]);
    let staging = gpu.staging("results", 16).unwrap();
    assert_eq!(gpu.mapped(&staging, 64, <[u8]>::to_vec).unwrap_err().kind, ErrorKind::Internal);
    assert_eq!(gpu.mapped(&staging, 16, <[u8]>::to_vec).unwrap(), [0; 16]);
    // An error belongs to the thread that made the call.
    let spoil = || gpu.queue.write_buffer(&buffer, 2, &[0; 4]);
    let spoilt = || gpu.check().is_err_and(|error| error.kind == ErrorKind::Internal);
    spoil();
    std::thread::scope(|scope| {
        scope.spawn(|| assert!(!spoilt()));
        scope.spawn(|| (spoil(), assert!(spoilt())));
    });
    assert!(spoilt());
    gpu.check().unwrap();
}

#[test]
fn memory_that_is_not_there_is_named_and_what_is_dropped_comes_back() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let error = gpu.buffer("coarse levels", u64::MAX, STORAGE).unwrap_err();
    assert_eq!(error.kind, ErrorKind::OutOfMemory);
    assert!(error.message.starts_with("coarse levels: 18446744073709551615 bytes on the GPU: "), "{error}");
    let allocated = || gpu.device.generate_allocator_report().map(|report| report.total_allocated_bytes);
    let Some(before) = allocated() else { return };
    let size = 64 << 20;
    for _ in 0..3 {
        let buffers: Vec<_> = (0..4).map(|_| gpu.buffer("level", size, STORAGE).unwrap()).collect();
        assert!(allocated().unwrap() > before + 3 * size, "{:?} after {before}", allocated());
        // The buffers are dropped while submitted work still uses them.
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        buffers.iter().for_each(|buffer| encoder.clear_buffer(buffer, 0, None));
        gpu.submit([encoder]).unwrap();
        drop(buffers);
        gpu.wait().unwrap();
        gpu.reclaim();
        assert!(allocated().unwrap() < before + size, "{:?} after {before}", allocated());
    }
}

/// Runs in a separate process with a memory limit: the software driver would otherwise use the whole address space.
#[cfg(target_os = "linux")]
#[test]
fn memory_that_is_short_is_named_and_the_gpu_stays() {
    const CHILD: &str = "VRTM_TEST_SHORT_OF_MEMORY";
    if std::env::var_os(CHILD).is_none() {
        let Some(gpu) = gpu(Options::default()) else { return };
        if !crate::identity::is_software(&gpu.adapter) {
            // The limit of this process does not apply to a driver with its own memory.
            return;
        }
        let name = "context::tests::memory_that_is_short_is_named_and_the_gpu_stays";
        let output = std::process::Command::new("sh")
            .args(["-c", "ulimit -v 6000000; exec \"$0\" \"$@\""])
            .arg(std::env::current_exe().unwrap())
            .args(["--exact", name, "--nocapture"])
            .env(CHILD, "1")
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success() && said.contains("1 passed"), "{output:?}");
        return;
    }
    let gpu = gpu(Options::default()).unwrap();
    let size = gpu.limits.max_buffer_size / 2;
    let mut buffers = Vec::new();
    let error = loop {
        match gpu.buffer("a level", size, STORAGE) {
            Ok(buffer) => buffers.push(buffer),
            Err(error) => break error,
        }
        assert!(buffers.len() < 100);
    };
    assert_eq!(error.kind, ErrorKind::OutOfMemory, "{error}");
    assert_eq!(error.message, format!("a level: {size} bytes on the GPU: out of memory"));
    assert!(!buffers.is_empty());
    drop(buffers);
    gpu.reclaim();
    let buffer = gpu.buffer("a level", size, STORAGE).unwrap();
    assert_eq!(gpu.read(&buffer, 0..16).unwrap(), [0; 16]);
}

#[test]
fn webgpu_s_limits_are_opened_exactly() {
    let Some(gpu) = gpu(Options { webgpu_limits: true, ..Options::default() }) else { return };
    assert_eq!(gpu.limits, wgpu::Limits::defaults());
    assert_eq!(gpu.device.limits(), wgpu::Limits::defaults());
    assert_eq!(gpu.device.features(), wgpu::Features::empty());
    assert!(!gpu.timestamps);
    assert_eq!(gpu.limits.max_storage_buffer_binding_size, 128 << 20);
    let error = gpu.buffer("large", (256 << 20) + 4, STORAGE).unwrap_err();
    assert_eq!(error.message, "large: 268435460 bytes on the GPU: its buffers hold at most 268435456");
    gpu.buffer("largest", 256 << 20, STORAGE).unwrap();
}

#[test]
fn a_lost_gpu_fails_every_call_and_never_panics() {
    let Some(gpu) = gpu(Options::default()) else { return };
    let buffer = gpu.buffer("small", 16, STORAGE).unwrap();
    let staging = gpu.staging("results", 16).unwrap();
    gpu.alive().unwrap();
    gpu.lose();
    let lost = |outcome: Result<()>| {
        let error = outcome.unwrap_err();
        assert_eq!(error.kind, ErrorKind::DeviceLost, "{error}");
        assert!(error.message.contains("is lost: it was destroyed"), "{error}");
    };
    lost(gpu.alive());
    lost(gpu.check());
    lost(gpu.wait());
    lost(gpu.buffer("another", 16, STORAGE).map(drop));
    gpu.queue.write_buffer(&buffer, 0, &[0; 16]);
    lost(filled(&gpu, &[0; 16]).map(drop));
    lost(gpu.read(&buffer, 0..16).map(drop));
    lost(gpu.mapped(&staging, 16, |_| ()));
    lost(gpu.submit([gpu.device.create_command_encoder(&Default::default())]));
    gpu.reclaim();
    gpu.lose();
    // Context and buffers can be dropped in any order, and the GPU can be opened again.
    drop(gpu);
    drop(buffer);
    self::gpu(Options::default()).unwrap().wait().unwrap();
}
