//! Maps in memory of this program's own Vulkan device that vrtm writes to: exported once, by a file descriptor, and copied
//! to a texture in each frame. Nothing of a map passes through the CPU.

use std::os::fd::{AsRawFd, FromRawFd, OwnedFd};

use ash::{khr, vk};
use vrtm::{ExternalHandle, ExternalImage, Origin, PixelFormat};
use wgpu::hal::api::Vulkan;

use super::Result;
use super::gpu::Gpu;

/// The UUID by which vrtm finds the same GPU; `None` if it is not driven through Vulkan.
pub fn uuid(gpu: &Gpu) -> Option<[u8; 16]> {
    // SAFETY: the device is only used here, not destroyed.
    let device = unsafe { gpu.device.as_hal::<Vulkan>() }?;
    let mut ids = vk::PhysicalDeviceIDProperties::default();
    let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut ids);
    let instance = device.shared_instance();
    if instance.instance_api_version() < vk::API_VERSION_1_1 {
        return None;
    }
    // SAFETY: the physical device belongs to this instance, which has Vulkan 1.1.
    unsafe {
        instance.raw_instance().get_physical_device_properties2(device.raw_physical_device(), &mut all)
    };
    Some(ids.device_uuid)
}

/// Deltas in f16 of all tiles, one after the other.
pub struct SharedMaps {
    buffer: wgpu::Buffer,
    raw: vk::Buffer,
    descriptor: OwnedFd,
    memory_size: u64,
    memory_type: u32,
    side: u32,
    layers: u32,
}

/// Bytes from one row of a map to the next, as a copy to a texture takes them.
fn row_stride(side: u32) -> u32 {
    (4 * side).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}

impl SharedMaps {
    /// # Errors
    /// A GPU that is not driven through Vulkan, or does not export memory as file descriptors; too little memory.
    pub fn new(gpu: &Gpu, side: u32, layers: u32) -> Result<SharedMaps> {
        // SAFETY: the device is only used here, not destroyed.
        let device =
            unsafe { gpu.device.as_hal::<Vulkan>() }.ok_or("memory is shared through Vulkan alone")?;
        if !device.enabled_device_extensions().contains(&khr::external_memory_fd::NAME) {
            return Err(format!("{} does not export memory as file descriptors", gpu.name));
        }
        let size = u64::from(row_stride(side)) * u64::from(side) * u64::from(layers);
        let said = |what: &'static str| move |result: vk::Result| format!("{what}: {result}");
        let types = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
        let (instance, own) = (device.shared_instance().raw_instance(), device.raw_device());
        // SAFETY: the structs live, the device has the extension, and the buffer is unused when it is bound.
        unsafe {
            let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(types);
            let usage = vk::BufferUsageFlags::TRANSFER_SRC;
            let info = vk::BufferCreateInfo::default().size(size).usage(usage).push_next(&mut external);
            let raw = own.create_buffer(&info, None).map_err(said("a shared buffer"))?;
            let needs = own.get_buffer_memory_requirements(raw);
            let all = instance.get_physical_device_memory_properties(device.raw_physical_device());
            let wanted = vk::MemoryPropertyFlags::DEVICE_LOCAL;
            let fits = |&k: &u32| {
                let flags = all.memory_types[k as usize].property_flags;
                needs.memory_type_bits & (1 << k) != 0 && flags.contains(wanted)
            };
            let memory_type =
                (0..all.memory_type_count).find(fits).ok_or("no memory of the device itself")?;
            let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(types);
            let info = vk::MemoryAllocateInfo::default().allocation_size(needs.size);
            let info = info.memory_type_index(memory_type).push_next(&mut export);
            let memory = own.allocate_memory(&info, None).map_err(said("shared memory"))?;
            own.bind_buffer_memory(raw, memory, 0).map_err(said("binding shared memory"))?;
            let info = vk::MemoryGetFdInfoKHR::default().memory(memory).handle_type(types);
            let descriptor = khr::external_memory_fd::Device::new(instance, own).get_memory_fd(&info);
            let descriptor = OwnedFd::from_raw_fd(descriptor.map_err(said("exporting the memory"))?);
            // From here on wgpu owns buffer and memory.
            let buffer = gpu.device.create_buffer_from_hal::<Vulkan>(
                wgpu::hal::vulkan::Buffer::from_raw_managed(raw, memory, 0, size),
                &wgpu::BufferDescriptor {
                    label: Some("maps"),
                    size,
                    usage: wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                },
            );
            Ok(SharedMaps { buffer, raw, descriptor, memory_size: needs.size, memory_type, side, layers })
        }
    }

    /// A tile's map, as vrtm takes it. The first row is v = 0, so that shaders use UVs as they are.
    pub fn image(&self, layer: u32) -> ExternalImage {
        let stride = u64::from(row_stride(self.side));
        ExternalImage {
            handle: ExternalHandle::OpaqueFd(self.descriptor.as_raw_fd()),
            memory_size: self.memory_size,
            memory_type: self.memory_type,
            offset: u64::from(layer) * u64::from(self.side) * stride,
            width: self.side,
            height: self.side,
            format: PixelFormat::F16,
            row_stride: Some(stride),
            origin: Origin::Bottom,
        }
    }

    /// Commands that take the memory over from vrtm, and copy all maps to the layers of a texture.
    pub fn copied_to(&self, gpu: &Gpu, texture: &wgpu::Texture) -> Vec<wgpu::CommandBuffer> {
        let encoder = || gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let (mut take, mut copy) = (encoder(), encoder());
        // SAFETY: the device is only used here, not destroyed.
        if let Some(device) = unsafe { gpu.device.as_hal::<Vulkan>() } {
            let barrier = vk::BufferMemoryBarrier::default()
                .buffer(self.raw)
                .size(vk::WHOLE_SIZE)
                .src_queue_family_index(vk::QUEUE_FAMILY_EXTERNAL)
                .dst_queue_family_index(device.queue_family_index())
                .dst_access_mask(vk::AccessFlags::TRANSFER_READ);
            use vk::PipelineStageFlags as Stage;
            let (from, to, none) = (Stage::TOP_OF_PIPE, Stage::TRANSFER, vk::DependencyFlags::empty());
            // SAFETY: the encoder is recording, nothing else records to it, and buffer and device are alive.
            unsafe {
                take.as_hal_mut::<Vulkan, _, _>(|commands| {
                    if let Some(commands) = commands {
                        let (commands, device) = (commands.raw_handle(), device.raw_device());
                        device.cmd_pipeline_barrier(commands, from, to, none, &[], &[barrier], &[]);
                    }
                });
            }
        }
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row_stride(self.side)),
            rows_per_image: Some(self.side),
        };
        copy.copy_buffer_to_texture(
            wgpu::TexelCopyBufferInfo { buffer: &self.buffer, layout },
            texture.as_image_copy(),
            wgpu::Extent3d { width: self.side, height: self.side, depth_or_array_layers: self.layers },
        );
        vec![take.finish(), copy.finish()]
    }
}
