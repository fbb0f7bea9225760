//! Imports memory of a host's Vulkan device as a buffer of this library's device.

/// The host's imported memory. Dropping the buffer ends this library's access to it.
pub(super) struct Imported {
    pub buffer: wgpu::Buffer,
    #[cfg(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd"))]
    raw: ash::vk::Buffer,
}

#[cfg(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd"))]
mod vulkan;

#[cfg(not(any(windows, target_os = "linux", target_os = "android", target_os = "freebsd")))]
mod nowhere {
    use super::Imported;
    use crate::context::Context;
    use vrtm_core::error::{Error, ErrorKind, Result};
    use vrtm_core::image::external::ExternalTexels;

    fn refused<T>() -> Result<T> {
        let message =
            "image.handle_kind: memory is imported through Vulkan, which is not used on this system";
        Err(Error::new(ErrorKind::Unsupported, message))
    }

    impl Imported {
        pub fn new(_: &Context, _: &ExternalTexels) -> Result<Imported> {
            refused()
        }

        pub fn transfers(&self, _: &Context) -> Result<(wgpu::CommandEncoder, wgpu::CommandEncoder)> {
            refused()
        }
    }
}
