//! An image that several threads write.

use std::sync::atomic::{AtomicPtr, Ordering};

use half::f16;

use vrtm_core::image::format::PixelFormat;
use vrtm_core::image::{ImageViewMut, TexelLayout};

/// Texels of an image that several threads write, each texel by one thread.
pub(crate) struct Canvas {
    pixels: AtomicPtr<u8>,
    layout: TexelLayout,
}

impl Canvas {
    pub fn new(image: &mut ImageViewMut) -> Canvas {
        Canvas { pixels: AtomicPtr::new(image.as_mut_ptr()), layout: image.layout }
    }

    pub fn format(&self) -> PixelFormat {
        self.layout.format
    }

    /// Writes the first channels of a texel; row 0 is at v = 0.
    #[inline(always)]
    pub fn put<const N: usize>(&self, x: usize, y: usize, values: [f64; N]) {
        self.put_from(0, [(x, y, values)]);
    }

    /// Writes a row from the bytes of its first two channels, in the image's format and without gaps; a third channel
    /// is 0. Row 0 is at v = 0.
    pub fn put_row(&self, y: usize, bytes: &[u8]) {
        let TexelLayout { width, height, channels, format, pixel_stride, .. } = self.layout;
        let (width, pair, third) =
            (width as usize, 2 * format.size(), usize::from(channels > 2) * format.size());
        assert!(y < height as usize && channels >= 2 && bytes.len() == width * pair);
        // SAFETY: as in `put_from`. All bytes of a float that is 0 are 0.
        unsafe {
            let to = self.pixels.load(Ordering::Relaxed).add(self.layout.offset(0, y));
            if pixel_stride == pair {
                to.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len());
                return;
            }
            for (x, texel) in bytes.chunks_exact(pair).enumerate() {
                let to = to.add(x * pixel_stride);
                to.copy_from_nonoverlapping(texel.as_ptr(), pair);
                to.add(pair).write_bytes(0, third);
            }
        }
    }

    /// Writes the channels of texels from number `first` on, as many as the image has. Each texel is given as column,
    /// row and values.
    #[inline(always)]
    pub fn put_from<const N: usize>(
        &self,
        first: usize,
        texels: impl IntoIterator<Item = (usize, usize, [f64; N])>,
    ) {
        // Values of this function, so that the loop need not read them again after each write.
        let (layout, pixels) = (self.layout, self.pixels.load(Ordering::Relaxed));
        let count = (layout.channels as usize).saturating_sub(first).min(N);
        for (x, y, values) in texels {
            assert!(x < layout.width as usize && y < layout.height as usize);
            // SAFETY: `ImageViewMut` checked that every channel of every texel of the layout lies in its bytes. Two
            // threads never write one texel: a warp without folds covers each texel once, and one with folds is written
            // by one thread (`Outputs::invert`).
            unsafe {
                let to = pixels.add(layout.offset(x, y));
                match layout.format {
                    PixelFormat::F16 => {
                        let to = to.cast::<f16>().add(first);
                        (0..count).for_each(|k| to.add(k).write_unaligned(half(values[k])));
                    }
                    _ => {
                        let to = to.cast::<f32>().add(first);
                        (0..count).for_each(|k| to.add(k).write_unaligned(values[k] as f32));
                    }
                }
            }
        }
    }
}

/// The nearest finite 16-bit float. A call, so that writing f32 is small enough to be inlined.
#[inline(never)]
fn half(value: f64) -> f16 {
    f16::from_f32(value as f32).clamp(f16::MIN, f16::MAX)
}
