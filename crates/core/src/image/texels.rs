//! Views of images that a program keeps as slices of numbers rather than of bytes.

use half::f16;

use crate::error::{Result, ensure};
use crate::view::as_bytes;

use super::{ImageLayout, ImageView, ImageViewMut, Origin, PixelFormat};

mod sealed {
    use super::PixelFormat;

    /// Numbers without padding, of which any bytes are a value.
    pub trait Texel: Copy {
        const FORMAT: PixelFormat;
        const CHANNELS: u32;
    }
}

/// A texel of a map to be read: [`u8`] or [`u16`], whose largest value stands for 1, [`struct@f16`] or [`f32`].
pub trait InputTexel: sealed::Texel {}

/// A texel of an image to be written: [`struct@f16`] or [`f32`], or an array of two to four of them, one for each
/// channel.
pub trait OutputTexel: sealed::Texel {}

macro_rules! texels {
    ($role:ident: $($texel:ty = $format:ident * $channels:literal),+) => {$(
        impl sealed::Texel for $texel {
            const FORMAT: PixelFormat = PixelFormat::$format;
            const CHANNELS: u32 = $channels;
        }
        impl $role for $texel {}
    )+};
}

texels!(InputTexel: u8 = U8 * 1, u16 = U16 * 1, f16 = F16 * 1, f32 = F32 * 1);
texels!(OutputTexel: [f16; 2] = F16 * 2, [f16; 3] = F16 * 3, [f16; 4] = F16 * 4);
texels!(OutputTexel: [f32; 2] = F32 * 2, [f32; 3] = F32 * 3, [f32; 4] = F32 * 4);
impl OutputTexel for f16 {}
impl OutputTexel for f32 {}

/// The packed layout of `count` texels that are to be as many as an image of this size has.
fn layout<T: sealed::Texel>(name: &str, count: usize, [width, height]: [u32; 2]) -> Result<ImageLayout> {
    let needed = u64::from(width) * u64::from(height);
    ensure!(count as u64 == needed, "{name}: {count} texels given, {width}x{height} are {needed}");
    Ok(ImageLayout::packed(width, height, T::FORMAT).with_channels(T::CHANNELS))
}

impl<'a> ImageView<'a> {
    /// A view of the texels of a map, row by row, with the first row at v = 1. `size` is its width and height; `name`
    /// is the argument's name, for messages.
    pub fn from_texels<T: InputTexel>(name: &str, texels: &'a [T], size: [u32; 2]) -> Result<ImageView<'a>> {
        ImageView::new(name, as_bytes(texels), layout::<T>(name, texels.len(), size)?)
    }

    /// The same view, with the first row at this end of the tile.
    #[must_use]
    pub fn with_origin(mut self, origin: Origin) -> ImageView<'a> {
        self.layout.origin = origin;
        self
    }
}

impl<'a> ImageViewMut<'a> {
    /// A view of texels that a map is to be written to, row by row, with the first row at v = 1. `size` is its width
    /// and height; `name` is the argument's name, for messages.
    ///
    /// # Example
    /// A square in its rest pose: each texel of the redirection has the UV of its own centre.
    ///
    /// ```
    /// # use vrtm::{Asset, Device, DeviceSettings, FetchKind, ImageViewMut, SolveOptions, Strided};
    /// # fn main() -> vrtm::Result<()> {
    /// # let (rest, source) = vrtm_core::fixtures::square();
    /// # let mut asset = Asset::new(&Device::new(&DeviceSettings::default())?, &source)?;
    /// # let tile = asset.find_tile(1001).expect("the UVs lie in the first tile");
    /// asset.solve(Strided::from_slice(&rest), &SolveOptions::default())?;
    /// let mut map = vec![[0.0f32; 2]; 4 * 4];
    /// asset.tile(tile).fetch(FetchKind::Redirection, &mut ImageViewMut::from_texels("map", &mut map, [4, 4])?)?;
    /// assert_eq!(map[0], [0.125, 0.875], "u, v of the first texel, at the top on the left");
    /// assert_eq!(map[15], [0.875, 0.125], "and of the last one");
    /// # Ok(())
    /// # }
    /// ```
    #[doc(alias = "from_f16x2")]
    pub fn from_texels<T: OutputTexel>(
        name: &str,
        texels: &'a mut [T],
        size: [u32; 2],
    ) -> Result<ImageViewMut<'a>> {
        let layout = layout::<T>(name, texels.len(), size)?;
        // SAFETY: the texels are borrowed for as long as the view lives, are as many as the layout says, and may have
        // any bytes.
        unsafe { ImageViewMut::from_raw(name, texels.as_mut_ptr().cast(), layout) }
    }

    /// The same view, with the first row at this end of the tile.
    #[must_use]
    pub fn with_origin(mut self, origin: Origin) -> ImageViewMut<'a> {
        self.layout.origin = origin;
        self
    }
}
