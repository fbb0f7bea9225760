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

    /// Writes the first channels of a texel; row 0 is at v = 0.
    #[inline(always)]
    pub fn put<const N: usize>(&self, x: usize, y: usize, values: [f64; N]) {
        self.put_from(0, x, y, values);
    }

    /// Writes the channels of a texel from number `first` on, as many as the image has.
    #[inline(always)]
    pub fn put_from<const N: usize>(&self, first: usize, x: usize, y: usize, values: [f64; N]) {
        let TexelLayout { width, height, channels, format, .. } = self.layout;
        assert!(x < width as usize && y < height as usize);
        let at = self.layout.offset(x, y);
        let count = (channels as usize).saturating_sub(first).min(N);
        // SAFETY: `ImageViewMut` checked that every channel of every texel of the layout lies in its bytes. Two threads
        // never write one texel: a warp without folds covers each texel once, and one with folds is written by one
        // thread (`Outputs::invert`).
        unsafe {
            let to = self.pixels.load(Ordering::Relaxed).add(at);
            match format {
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

/// The nearest finite 16-bit float.
fn half(value: f64) -> f16 {
    f16::from_f32(value as f32).clamp(f16::MIN, f16::MAX)
}
