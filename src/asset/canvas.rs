//! An image that several threads write.

use std::sync::atomic::{AtomicPtr, Ordering};

use half::f16;

use crate::image::{ImageViewMut, PixelFormat, TexelLayout};

/// Texels of an image that several threads write, each its own.
pub(super) struct Canvas {
    pixels: AtomicPtr<u8>,
    layout: TexelLayout,
}

impl Canvas {
    pub fn new(image: &mut ImageViewMut) -> Canvas {
        Canvas { pixels: AtomicPtr::new(image.as_mut_ptr()), layout: image.layout }
    }

    /// Writes one texel; row 0 is at v = 0.
    pub fn put(&self, x: usize, y: usize, uv: [f64; 2]) {
        assert!(x < self.layout.width as usize && y < self.layout.height as usize);
        let at = self.layout.offset(x, y);
        // SAFETY: `ImageViewMut` checked that every texel of the layout lies in its bytes. Two threads never write one
        // texel: a warp without folds covers each texel once, and one with folds is written by one thread (`Outputs::invert`).
        unsafe {
            let to = self.pixels.load(Ordering::Relaxed).add(at);
            match self.layout.format {
                PixelFormat::F16 => {
                    let pair = uv.map(|x| f16::from_f32(x as f32));
                    to.cast::<[f16; 2]>().write_unaligned(pair);
                }
                _ => to.cast::<[f32; 2]>().write_unaligned(uv.map(|x| x as f32)),
            }
        }
    }
}
