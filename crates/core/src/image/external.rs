//! Images in memory of a host's own graphics device, which results are written to without passing through the CPU.

use crate::error::{Error, ErrorKind, Result};

use super::Origin;
use super::format::PixelFormat;

/// A handle of memory that a host's graphics device has exported.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExternalHandle {
    /// `VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD_BIT`, from `vkGetMemoryFdKHR`. The caller remains responsible for
    /// closing it.
    OpaqueFd(i32),
    /// `VK_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_WIN32_BIT`, from `vkGetMemoryWin32HandleKHR`. The caller remains
    /// responsible for closing it.
    OpaqueWin32(isize),
}

/// An output image in memory of the host's graphics device: rows of texels in a buffer, two channels per texel. The
/// memory must be allocated without `VkMemoryDedicatedAllocateInfo`, on a device whose `deviceUUID` and `driverUUID`
/// are those of the adapter ([`crate::AdapterInfo`]).
#[derive(Clone, Copy, Debug)]
pub struct ExternalImage {
    /// The exported memory.
    pub handle: ExternalHandle,
    /// The `VkMemoryAllocateInfo::allocationSize` of the memory.
    pub memory_size: u64,
    /// The `VkMemoryAllocateInfo::memoryTypeIndex` of the memory.
    pub memory_type: u32,
    /// Bytes from the start of the memory to the first texel of the first row, a multiple of a texel's.
    pub offset: u64,
    /// Texels in u.
    pub width: u32,
    /// Texels in v.
    pub height: u32,
    /// Number format of a channel: f32, or f16, with which a texel takes 4 bytes in place of 8.
    pub format: PixelFormat,
    /// Bytes from one row to the next, a multiple of a texel's; `None` = packed. Bytes between rows are left alone.
    pub row_stride: Option<u64>,
    /// The end of the tile at which the first row lies.
    pub origin: Origin,
}

/// A checked [`ExternalImage`].
#[derive(Clone, Copy, Debug)]
pub struct ExternalTexels {
    pub handle: ExternalHandle,
    pub memory_size: u64,
    pub memory_type: u32,
    pub offset: u64,
    pub size: [usize; 2],
    pub format: PixelFormat,
    pub row_stride: u64,
    pub is_top_first: bool,
    /// The end of the last texel, in bytes from the start of the memory.
    pub end: u64,
}

impl ExternalImage {
    /// Checks everything that needs no device.
    ///
    /// # Errors
    /// `InvalidArgument` naming `name` and the field; `Unsupported` for integer formats.
    pub fn check(&self, name: &str) -> Result<ExternalTexels> {
        let &ExternalImage { width, height, memory_size, offset, format, .. } = self;
        let bad = |message: String| Err(Error::argument(format!("{name}.{message}")));
        if !matches!(format, PixelFormat::F16 | PixelFormat::F32) {
            let message = format!("{name}.format must be f32 or f16 for an output");
            return Err(Error::new(ErrorKind::Unsupported, message));
        }
        for (field, side) in [("width", width), ("height", height)] {
            if side == 0 {
                return bad(format!("{field} is 0"));
            }
        }
        let texel = 2 * format.size() as u64;
        let row = u64::from(width) * texel;
        let row_stride = self.row_stride.unwrap_or(row);
        if row_stride < row {
            return bad(format!("row_stride is {row_stride} bytes, smaller than a row ({row} bytes)"));
        }
        for (field, bytes) in [("row_stride", row_stride), ("offset", offset)] {
            if bytes % texel != 0 {
                return bad(format!("{field} is {bytes} bytes, no multiple of a texel's {texel}"));
            }
        }
        let end = row_stride
            .checked_mul(u64::from(height) - 1)
            .and_then(|bytes| bytes.checked_add(row)?.checked_add(offset));
        let Some(end) = end.filter(|&end| end <= memory_size) else {
            let needed = end.map_or("more than 2^64".to_owned(), |end| end.to_string());
            return bad(format!(
                "memory_size is {memory_size} bytes, but {width}x{height} texels from offset {offset} on, rows \
                 {row_stride} bytes apart, need {needed}"
            ));
        };
        Ok(ExternalTexels {
            handle: self.handle,
            memory_size,
            memory_type: self.memory_type,
            offset,
            size: [width as usize, height as usize],
            format,
            row_stride,
            is_top_first: self.origin == Origin::Top,
            end,
        })
    }
}
