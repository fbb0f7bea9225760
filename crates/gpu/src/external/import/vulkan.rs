//! Imports memory through Vulkan. wgpu-hal opens every device with VK_KHR_external_memory_fd or
//! VK_KHR_external_memory_win32 if the driver has the extension.

use std::ffi::CStr;

use ash::{khr, vk};
use wgpu::hal::api::Vulkan;

use super::Imported;
use crate::context::Context;
use vrtm_core::error::{Error, ErrorKind, Result};
use vrtm_core::image::external::{ExternalHandle, ExternalTexels};

/// The usage of imported memory.
const USAGE: vk::BufferUsageFlags = vk::BufferUsageFlags::STORAGE_BUFFER;

fn unsupported(message: String) -> Error {
    Error::new(ErrorKind::Unsupported, message)
}

/// The error of a failed Vulkan call.
fn failed(what: &str, result: vk::Result) -> Error {
    match result {
        vk::Result::ERROR_INVALID_EXTERNAL_HANDLE => Error::argument(format!(
            "image.handle: the driver does not take it: not of such memory, or of another GPU or driver ({what})"
        )),
        vk::Result::ERROR_OUT_OF_HOST_MEMORY
        | vk::Result::ERROR_OUT_OF_DEVICE_MEMORY
        | vk::Result::ERROR_TOO_MANY_OBJECTS => {
            Error::new(ErrorKind::OutOfMemory, format!("image: {what}: {result}"))
        }
        _ => Error::new(ErrorKind::Internal, format!("the GPU: {what}: {result}")),
    }
}

/// The Vulkan type of a handle, and the extension that it needs.
fn kind(handle: ExternalHandle) -> (vk::ExternalMemoryHandleTypeFlags, &'static CStr) {
    use vk::ExternalMemoryHandleTypeFlags as Types;
    match handle {
        ExternalHandle::OpaqueFd(_) => (Types::OPAQUE_FD, khr::external_memory_fd::NAME),
        ExternalHandle::OpaqueWin32(_) => (Types::OPAQUE_WIN32, khr::external_memory_win32::NAME),
    }
}

/// Vulkan objects that are destroyed on drop, unless a wgpu buffer has taken them over.
struct Raw<'a> {
    device: &'a ash::Device,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
}

impl Drop for Raw<'_> {
    fn drop(&mut self) {
        // SAFETY: no work uses them, and both may be null.
        unsafe {
            self.device.destroy_buffer(self.buffer, None);
            self.device.free_memory(self.memory, None);
        }
    }
}

impl Imported {
    /// Imports the memory that an image lies in.
    ///
    /// # Errors
    /// `Unsupported` if this GPU cannot import such memory; `InvalidArgument` if the handle, the size or the memory
    /// type does not match; `OutOfMemory`.
    pub fn new(context: &Context, texels: &ExternalTexels) -> Result<Imported> {
        context.contain(|| import(context, texels))?
    }

    /// Commands that acquire the memory from the host's device, and commands that release it so that the host's device
    /// sees what was written.
    pub fn transfers(&self, context: &Context) -> Result<(wgpu::CommandEncoder, wgpu::CommandEncoder)> {
        Ok((self.transfer(context, true)?, self.transfer(context, false)?))
    }

    fn transfer(&self, context: &Context, takes: bool) -> Result<wgpu::CommandEncoder> {
        context.contain(|| {
            let label = wgpu::CommandEncoderDescriptor { label: Some("ownership") };
            let mut encoder = context.device.create_command_encoder(&label);
            // SAFETY: the device is only used here, not destroyed.
            let device = unsafe { context.device.as_hal::<Vulkan>() };
            let Some(device) = device else { return encoder };
            let (own, outside) = (device.queue_family_index(), vk::QUEUE_FAMILY_EXTERNAL);
            let barrier = vk::BufferMemoryBarrier::default().buffer(self.raw).size(vk::WHOLE_SIZE);
            use vk::{AccessFlags as Access, PipelineStageFlags as Stage};
            let (barrier, from, to) = if takes {
                let barrier = barrier.src_queue_family_index(outside).dst_queue_family_index(own);
                let access = Access::SHADER_READ | Access::SHADER_WRITE;
                (barrier.dst_access_mask(access), Stage::TOP_OF_PIPE, Stage::COMPUTE_SHADER)
            } else {
                let barrier = barrier.src_queue_family_index(own).dst_queue_family_index(outside);
                (barrier.src_access_mask(Access::SHADER_WRITE), Stage::COMPUTE_SHADER, Stage::BOTTOM_OF_PIPE)
            };
            // SAFETY: the encoder is recording, nothing else records to it, and buffer and device are alive.
            unsafe {
                encoder.as_hal_mut::<Vulkan, _, _>(|commands| {
                    if let Some(commands) = commands {
                        let (commands, none) = (commands.raw_handle(), vk::DependencyFlags::empty());
                        let device = device.raw_device();
                        device.cmd_pipeline_barrier(commands, from, to, none, &[], &[barrier], &[]);
                    }
                });
            }
            encoder
        })
    }
}

fn import(context: &Context, texels: &ExternalTexels) -> Result<Imported> {
    let adapter = &context.adapter;
    // SAFETY: the device is only used here, not destroyed.
    let device = unsafe { context.device.as_hal::<Vulkan>() }.ok_or_else(|| {
        unsupported(format!(
            "image.handle: memory is imported through Vulkan alone, but {} is driven through {}",
            adapter.name, context.about.api
        ))
    })?;
    let (types, extension) = kind(texels.handle);
    let shared = device.shared_instance();
    let (instance, physical) = (shared.raw_instance(), device.raw_physical_device());
    // SAFETY: the device belongs to this instance.
    let version = unsafe { instance.get_physical_device_properties(physical) }.api_version;
    let has_extension = device.enabled_device_extensions().contains(&extension);
    if !has_extension || version.min(shared.instance_api_version()) < vk::API_VERSION_1_1 {
        return Err(unsupported(format!(
            "image.handle_kind: {} lacks {} or Vulkan 1.1, which such memory takes",
            adapter.name,
            extension.to_string_lossy()
        )));
    }
    let mut properties = vk::ExternalBufferProperties::default();
    let asked = vk::PhysicalDeviceExternalBufferInfo::default().usage(USAGE).handle_type(types);
    // SAFETY: instance and device have Vulkan 1.1, which includes the function.
    unsafe {
        instance.get_physical_device_external_buffer_properties(physical, &asked, &mut properties);
    }
    let features = properties.external_memory_properties.external_memory_features;
    if !features.contains(vk::ExternalMemoryFeatureFlags::IMPORTABLE) {
        let message = format!("image.handle_kind: {} imports no such memory for buffers", adapter.name);
        return Err(unsupported(message));
    }
    if features.contains(vk::ExternalMemoryFeatureFlags::DEDICATED_ONLY) {
        let message =
            format!("image.handle_kind: {} imports such memory only if it is dedicated", adapter.name);
        return Err(unsupported(message));
    }
    let raw = bound(device.raw_device(), texels, types)?;
    let descriptor = wgpu::BufferDescriptor {
        label: Some("image of the host"),
        size: texels.end,
        usage: wgpu::BufferUsages::STORAGE,
        mapped_at_creation: false,
    };
    let (buffer, memory) = (raw.buffer, raw.memory);
    // wgpu owns the objects from here on.
    std::mem::forget(raw);
    // SAFETY: buffer and memory belong to this device, are unused, and are bound to each other; the host guarantees the
    // memory's content.
    let wrapped = unsafe {
        let hal = wgpu::hal::vulkan::Buffer::from_raw_managed(buffer, memory, 0, texels.end);
        context.device.create_buffer_from_hal::<Vulkan>(hal, &descriptor)
    };
    Ok(Imported { buffer: wrapped, raw: buffer })
}

/// Creates a buffer on the imported memory, from its beginning to the image's end.
fn bound<'a>(
    device: &'a ash::Device,
    texels: &ExternalTexels,
    types: vk::ExternalMemoryHandleTypeFlags,
) -> Result<Raw<'a>> {
    let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(types);
    let info = vk::BufferCreateInfo::default().size(texels.end).usage(USAGE).push_next(&mut external);
    // SAFETY: the device was opened with what these calls need, and the structs are alive.
    let mut raw = unsafe {
        let buffer = device.create_buffer(&info, None).map_err(|result| failed("a buffer", result))?;
        Raw { device, buffer, memory: vk::DeviceMemory::null() }
    };
    // SAFETY: the buffer belongs to this device.
    let needs = unsafe { device.get_buffer_memory_requirements(raw.buffer) };
    if texels.memory_type >= 32 || needs.memory_type_bits & (1 << texels.memory_type) == 0 {
        return Err(Error::argument(format!(
            "image.memory_type is {}, but such a buffer may lie in those of the bits {:#x} alone",
            texels.memory_type, needs.memory_type_bits
        )));
    }
    if needs.size > texels.memory_size {
        return Err(Error::argument(format!(
            "image.memory_size is {} bytes, but a buffer of {} needs {}",
            texels.memory_size, texels.end, needs.size
        )));
    }
    raw.memory = allocate(device, texels)?;
    // SAFETY: the memory is new, large enough and of a type that the buffer supports.
    unsafe { device.bind_buffer_memory(raw.buffer, raw.memory, 0) }
        .map_err(|result| failed("binding the memory", result))?;
    Ok(raw)
}

fn allocate(device: &ash::Device, texels: &ExternalTexels) -> Result<vk::DeviceMemory> {
    let info = vk::MemoryAllocateInfo::default()
        .allocation_size(texels.memory_size)
        .memory_type_index(texels.memory_type);
    match texels.handle {
        ExternalHandle::OpaqueFd(fd) => allocate_fd(device, info, fd),
        ExternalHandle::OpaqueWin32(handle) => allocate_win32(device, info, handle),
    }
}

#[cfg(unix)]
fn allocate_fd(device: &ash::Device, info: vk::MemoryAllocateInfo<'_>, fd: i32) -> Result<vk::DeviceMemory> {
    use std::os::fd::{AsRawFd, BorrowedFd, IntoRawFd};

    if fd < 0 {
        return Err(Error::argument(format!("image.handle is {fd}, no file descriptor")));
    }
    // A driver that imports a descriptor owns it, so it gets a duplicate, and the caller keeps the original. SAFETY:
    // the descriptor is not -1; one that is not open gives an error.
    let own = unsafe { BorrowedFd::borrow_raw(fd) }
        .try_clone_to_owned()
        .map_err(|error| Error::argument(format!("image.handle is {fd}: {error}")))?;
    let mut import = vk::ImportMemoryFdInfoKHR::default()
        .handle_type(vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD)
        .fd(own.as_raw_fd());
    // SAFETY: the device has the extension; the host guarantees the descriptor.
    let memory = unsafe { device.allocate_memory(&info.push_next(&mut import), None) }
        .map_err(|result| failed("importing the memory", result))?;
    let _ = own.into_raw_fd();
    Ok(memory)
}

#[cfg(not(unix))]
fn allocate_fd(_: &ash::Device, _: vk::MemoryAllocateInfo<'_>, _: i32) -> Result<vk::DeviceMemory> {
    Err(unsupported("image.handle_kind: this system has no file descriptors".to_owned()))
}

/// This is compiled for Windows, but was never run by its author.
#[cfg(windows)]
fn allocate_win32(
    device: &ash::Device,
    info: vk::MemoryAllocateInfo<'_>,
    handle: isize,
) -> Result<vk::DeviceMemory> {
    // Such an import does not take ownership of the handle.
    let mut import = vk::ImportMemoryWin32HandleInfoKHR::default()
        .handle_type(vk::ExternalMemoryHandleTypeFlags::OPAQUE_WIN32)
        .handle(handle);
    // SAFETY: the device has the extension; the host guarantees the handle.
    unsafe { device.allocate_memory(&info.push_next(&mut import), None) }
        .map_err(|result| failed("importing the memory", result))
}

#[cfg(not(windows))]
fn allocate_win32(_: &ash::Device, _: vk::MemoryAllocateInfo<'_>, _: isize) -> Result<vk::DeviceMemory> {
    Err(unsupported("image.handle_kind: this system has no Windows handles".to_owned()))
}
