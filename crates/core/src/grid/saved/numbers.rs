//! Numbers, and arrays of numbers, as little-endian bytes.

use std::array::from_fn;

use crate::allocation::Vec;
use crate::error::{Error, Result};

/// The error of bytes that cannot be a saved grid.
pub fn refuse(why: &str) -> Error {
    Error::argument(format!("data: {why}"))
}

/// A number or an array.
pub trait Saved: Copy {
    /// Bytes of a value.
    const SIZE: usize;
    /// The value that exactly `SIZE` bytes hold.
    fn read(bytes: &[u8]) -> Self;
    /// Writes the value to exactly `SIZE` bytes.
    fn write(&self, out: &mut [u8]);
}

macro_rules! numbers {
    ($($number:ty)*) => {$(
        impl Saved for $number {
            const SIZE: usize = size_of::<$number>();

            fn read(bytes: &[u8]) -> $number {
                <$number>::from_le_bytes(from_fn(|n| bytes[n]))
            }

            fn write(&self, out: &mut [u8]) {
                out.copy_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}

numbers!(u8 u16 u32 u64 u128 f32);

impl<T: Saved, const N: usize> Saved for [T; N] {
    const SIZE: usize = N * T::SIZE;

    fn read(bytes: &[u8]) -> [T; N] {
        from_fn(|n| T::read(&bytes[n * T::SIZE..(n + 1) * T::SIZE]))
    }

    fn write(&self, out: &mut [u8]) {
        self.iter().zip(out.chunks_exact_mut(T::SIZE)).for_each(|(x, out)| x.write(out));
    }
}

/// Takes values off the front of bytes; it allocates no more than there are bytes.
pub struct Reader<'a>(pub &'a [u8]);

impl Reader<'_> {
    pub fn one<T: Saved>(&mut self) -> Result<T> {
        self.slice(T::SIZE).map(T::read)
    }

    pub fn all<T: Saved>(&mut self, count: usize) -> Result<Vec<T>> {
        let bytes = self.slice(count.saturating_mul(T::SIZE))?;
        Ok(bytes.chunks_exact(T::SIZE).map(T::read).collect())
    }

    fn slice(&mut self, bytes: usize) -> Result<&[u8]> {
        let (slice, rest) = self.0.split_at_checked(bytes).ok_or_else(|| refuse("it is cut short"))?;
        self.0 = rest;
        Ok(slice)
    }
}

/// Writes values in sequence, or counts their bytes.
pub struct Writer<'a> {
    pub out: Option<&'a mut [u8]>,
    pub at: usize,
}

impl Writer<'_> {
    pub fn one(&mut self, value: impl Saved) {
        self.all([value].into_iter());
    }

    pub fn all<T: Saved>(&mut self, values: impl ExactSizeIterator<Item = T>) {
        let end = self.at + values.len() * T::SIZE;
        if let Some(out) = &mut self.out {
            let out = out[self.at..end].chunks_exact_mut(T::SIZE);
            values.zip(out).for_each(|(value, out)| value.write(out));
        }
        self.at = end;
    }
}
