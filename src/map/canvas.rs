//! An image that several threads write.

use std::sync::atomic::{AtomicPtr, Ordering};

use half::f16;

use crate::image::format::PixelFormat;
use crate::image::{ImageViewMut, TexelLayout};

/// Texels of an image that several threads write, each texel by one thread.
pub(crate) struct Canvas {
    pixels: AtomicPtr<u8>,
    layout: TexelLayout,
}

impl Canvas {
    pub fn new(image: &mut ImageViewMut) -> Canvas {
        Canvas { pixels: AtomicPtr::new(image.as_mut_ptr()), layout: image.layout }
    }

    /// The first two channels of a texel that has been written; row 0 is at v = 0.
    #[inline(always)]
    pub fn get(&self, x: usize, y: usize) -> [f64; 2] {
        let TexelLayout { width, height, channels, format, .. } = self.layout;
        assert!(x < width as usize && y < height as usize && channels >= 2);
        let at = self.layout.offset(x, y);
        // SAFETY: as in `put_from`, and the texel has been written.
        unsafe {
            let from = self.pixels.load(Ordering::Relaxed).add(at);
            match format {
                PixelFormat::F16 => {
                    let [x, y] = from.cast::<[f16; 2]>().read_unaligned();
                    [x.into(), y.into()]
                }
                _ => {
                    let [x, y] = from.cast::<[f32; 2]>().read_unaligned();
                    [x.into(), y.into()]
                }
            }
        }
    }

    /// The largest relative rounding error of a written number.
    pub fn epsilon(&self) -> f64 {
        match self.layout.format {
            PixelFormat::F16 => f64::from(f16::EPSILON) / 2.0,
            _ => f64::from(f32::EPSILON) / 2.0,
        }
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

/// The nearest finite 16-bit float, ties to even. `f16::from_f32` asks for the processor's features each time.
#[inline(always)]
fn half(value: f64) -> f16 {
    let x = value as f32;
    let sign = (x.to_bits() >> 16) as u16 & 0x8000;
    let size = x.abs().min(f16::MAX.to_f32());
    // Over 2^-14, the exponent changes its bias and the mantissa loses 13 bits. Below, the addition rounds to the step of the
    // subnormal numbers, 2^-24, which is that of f32 at 1/2.
    let bits = if size.to_bits() >= 0x3880_0000 {
        let (bits, is_odd) = (size.to_bits(), size.to_bits() >> 13 & 1);
        (bits + 0xfff + is_odd - (112 << 23)) >> 13
    } else {
        (size + 0.5).to_bits() - 0.5f32.to_bits()
    };
    f16::from_bits(bits as u16 | sign)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_half_is_the_nearest_finite_one() {
        let expected = |x: f32| f16::from_f32(x).clamp(f16::MIN, f16::MAX).to_bits();
        // All exponents, with mantissas near ties and others.
        for high in 0..1u32 << 16 {
            for low in [0, 1, 0x0fff, 0x1000, 0x1001, 0x1fff, 0x2000, 0x3000, 0x7fff, 0xf000, 0xffff] {
                let x = f32::from_bits(high << 16 | low);
                if !x.is_nan() {
                    assert_eq!(half(f64::from(x)).to_bits(), expected(x), "{x:e}");
                }
            }
        }
    }
}
