//! Number formats of a host's images.

use half::f16;

/// The number format of an image's channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum PixelFormat {
    /// 8-bit integer, 0..255 for 0..1. Inputs only.
    U8,
    /// 16-bit integer, 0..65535 for 0..1. Inputs only.
    U16,
    /// 16-bit float (IEEE half).
    F16,
    /// 32-bit float.
    F32,
}

impl PixelFormat {
    /// Bytes of one channel.
    #[must_use]
    pub fn size(self) -> usize {
        match self {
            PixelFormat::U8 => 1,
            PixelFormat::U16 | PixelFormat::F16 => 2,
            PixelFormat::F32 => 4,
        }
    }
}

/// The value of a channel.
#[inline(always)]
pub fn decode(format: PixelFormat, b: &[u8]) -> f32 {
    match format {
        PixelFormat::U8 => f32::from(b[0]) / 255.0,
        PixelFormat::U16 => f32::from(u16::from_ne_bytes([b[0], b[1]])) / 65535.0,
        PixelFormat::F16 => f16::from_ne_bytes([b[0], b[1]]).to_f32(),
        PixelFormat::F32 => f32::from_ne_bytes([b[0], b[1], b[2], b[3]]),
    }
}

/// The values of channels one after the other, clamped to 0..1.
pub fn decode_all(format: PixelFormat, bytes: &[u8], values: &mut [f32]) {
    match format {
        PixelFormat::U8 => all::<1>(bytes, values, |[b]| f32::from(b) / 255.0),
        PixelFormat::U16 => all::<2>(bytes, values, |b| decode(PixelFormat::U16, &b)),
        PixelFormat::F16 => all::<2>(bytes, values, |b| decode(PixelFormat::F16, &b).clamp(0.0, 1.0)),
        PixelFormat::F32 => all::<4>(bytes, values, |b| decode(PixelFormat::F32, &b).clamp(0.0, 1.0)),
    }
}

#[inline(always)]
fn all<const N: usize>(bytes: &[u8], values: &mut [f32], value: impl Fn([u8; N]) -> f32) {
    for (of, bytes) in values.iter_mut().zip(bytes.as_chunks::<N>().0) {
        *of = value(*bytes);
    }
}
