//! Writing results into memory of the host's graphics device.

use super::desc::{self, sized};
use super::fetch::{fetch_kind, vrtm_fetch_kind};
use super::guard::guard;
use super::handle::{self, vrtm_tile};
use super::mirror::Mirror;
use super::status::{Failure, Outcome, vrtm_status};
use super::types::{vrtm_origin, vrtm_pixel_format};
use vrtm_core::image::Origin;
use vrtm_core::image::external::{ExternalHandle, ExternalImage};
use vrtm_core::image::format::PixelFormat;

/// The kind of handle that a host has exported its memory as.
pub type vrtm_external_kind = i32;
/// A file descriptor from vkGetMemoryFdKHR with VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT: on Linux.
pub const VRTM_EXTERNAL_OPAQUE_FD: vrtm_external_kind = 1;
/// An NT handle from vkGetMemoryWin32HandleKHR with VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_WIN32_BIT: on Windows.
/// Compiled, but never run by the authors of this version.
pub const VRTM_EXTERNAL_OPAQUE_WIN32: vrtm_external_kind = 2;

/// An output image in memory of the host's own Vulkan device: rows of texels of two floats each, laid out as in a
/// buffer that shaders read or that is copied to an image (VK_FORMAT_R32G32_SFLOAT, with f16 VK_FORMAT_R16G16_SFLOAT).
/// Start from vrtm_external_image_init().
///
/// The host allocates the memory with VkExportMemoryAllocateInfo, without VkMemoryDedicatedAllocateInfo, on a device
/// whose deviceUUID and driverUUID equal those of the adapter (vrtm_adapter_info), as Vulkan requires.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_external_image {
    /// sizeof(vrtm_external_image); set by vrtm_external_image_init().
    pub struct_size: u32,
    /// One of VRTM_EXTERNAL_. Required.
    pub handle_kind: vrtm_external_kind,
    /// The file descriptor, or the handle's bits. The caller keeps ownership: the library imports a duplicate of a
    /// descriptor, so that the same descriptor can be passed again for the next frame, and the caller closes it.
    pub handle: u64,
    /// VkMemoryAllocateInfo::allocationSize of the memory. Required.
    pub memory_size: u64,
    /// VkMemoryAllocateInfo::memoryTypeIndex of the memory.
    pub memory_type: u32,
    /// VRTM_PIXEL_F32 (0, the default) or VRTM_PIXEL_F16, which is for the delta and takes half of the bytes.
    pub format: vrtm_pixel_format,
    /// Texels in u, at least 1.
    pub width: u32,
    /// Texels in v, at least 1.
    pub height: u32,
    /// VRTM_ORIGIN_TOP (0, the default) or VRTM_ORIGIN_BOTTOM.
    pub origin: vrtm_origin,
    /// Bytes from the start of the memory to the first texel of the first row, a multiple of a texel's: 8, with f16 4.
    pub offset: u64,
    /// Bytes from one row to the next, a multiple of a texel's; 0 = tightly packed. Bytes between rows are not written.
    pub row_stride: u64,
}

// SAFETY: repr(C), struct_size first, plain numbers.
sized!(vrtm_external_image);

unsafe fn read(image: *const vrtm_external_image, name: &str) -> Outcome<ExternalImage> {
    // SAFETY: the host's pointer.
    let image = unsafe { desc::read(image, name) }?;
    let bad = || Failure::argument(format!("{name}.handle is {}, no file descriptor", image.handle));
    let handle = match image.handle_kind {
        VRTM_EXTERNAL_OPAQUE_FD => ExternalHandle::OpaqueFd(i32::try_from(image.handle).map_err(|_| bad())?),
        VRTM_EXTERNAL_OPAQUE_WIN32 => ExternalHandle::OpaqueWin32(image.handle as isize),
        other => {
            return Err(Failure::argument(format!("{name}.handle_kind is {other}, no VRTM_EXTERNAL_ value")));
        }
    };
    Ok(ExternalImage {
        handle,
        memory_size: image.memory_size,
        memory_type: image.memory_type,
        offset: image.offset,
        width: image.width,
        height: image.height,
        format: PixelFormat::from_c(image.format, &format!("{name}.format"))?,
        row_stride: (image.row_stride != 0).then_some(image.row_stride),
        origin: Origin::from_c(image.origin, &format!("{name}.origin"))?,
    })
}

/// Writes a redirection of the last solve into memory of the host's own Vulkan device, which must be the same GPU
/// (vrtm_device_desc.adapter_by), without copying through the CPU. The texels equal those of vrtm_asset_fetch bit for
/// bit. Kinds: REDIRECTION, REDIRECTION_DELTA and REDIRECTION_UDIM, of two channels.
///
/// Nothing on the host's device may use the texels during the call. The call returns when the GPU has written them, so
/// that the host needs no semaphore. docs/hosts.md says how a buffer with exclusive sharing is handed over.
///
/// Errors: those of vrtm_asset_fetch; VRTM_ERROR_UNSUPPORTED if the asset's device is the CPU, for other kinds and
/// formats, and for handles that this GPU, its driver or this system does not import; VRTM_ERROR_INVALID_ARGUMENT for
/// an offset or stride that is no multiple of a texel, memory that is too small, a handle that does not refer to
/// memory, or a memory type that cannot hold buffers. After VRTM_ERROR_DEVICE_LOST the texels are undefined.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_tile_fetch_external(
    tile: vrtm_tile,
    kind: vrtm_fetch_kind,
    image: *const vrtm_external_image,
) -> vrtm_status {
    guard("vrtm_tile_fetch_external", || {
        let (asset, tile) = handle::tile("tile", tile)?;
        let kind = fetch_kind(kind, "kind")?;
        // SAFETY: the host's pointer, valid during the call.
        let image = unsafe { read(image, "image") }?;
        // SAFETY: the host vouches for the handle, and for the use of the memory.
        Ok(unsafe { asset.results.tile(tile).fetch_external(kind, &image) }?)
    })
}
