//! Plain loops over arrays: for processors without a level of their own, and the definition of what the others do.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::{LANES, Lanes, Lengths, Mask};

/// Eight f32.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub struct Portable([f32; LANES]);

/// Eight truth values: all bits of a lane are set or none.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct LaneMask([u32; LANES]);

macro_rules! lanewise {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl $trait for Portable {
            type Output = Portable;
            #[inline(always)]
            fn $method(self, other: Portable) -> Portable {
                let mut out = self;
                for k in 0..LANES {
                    out.0[k] = self.0[k] $op other.0[k];
                }
                out
            }
        }
        impl $trait<f32> for Portable {
            type Output = Portable;
            #[inline(always)]
            fn $method(self, other: f32) -> Portable {
                self $op Portable([other; LANES])
            }
        }
    )*};
}

lanewise!(Add add +, Sub sub -, Mul mul *, Div div /);

impl AddAssign for Portable {
    #[inline(always)]
    fn add_assign(&mut self, other: Portable) {
        *self = *self + other;
    }
}

impl SubAssign for Portable {
    #[inline(always)]
    fn sub_assign(&mut self, other: Portable) {
        *self = *self - other;
    }
}

impl Neg for Portable {
    type Output = Portable;
    #[inline(always)]
    fn neg(self) -> Portable {
        Portable(self.0.map(|x| -x))
    }
}

impl Portable {
    #[inline(always)]
    fn with(self, other: Portable, f: impl Fn(f32, f32) -> f32) -> Portable {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] = f(self.0[k], other.0[k]);
        }
        out
    }

    #[inline(always)]
    fn compare(self, other: Portable, f: impl Fn(&f32, &f32) -> bool) -> LaneMask {
        let mut out = LaneMask([0; LANES]);
        for k in 0..LANES {
            out.0[k] = if f(&self.0[k], &other.0[k]) { u32::MAX } else { 0 };
        }
        out
    }
}

impl Lanes for Portable {
    type Mask = LaneMask;
    type Index = [u32; LANES];

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Portable([x; LANES])
    }

    #[inline(always)]
    fn from_array(values: [f32; LANES]) -> Self {
        Portable(values)
    }

    #[inline(always)]
    fn to_array(self) -> [f32; LANES] {
        self.0
    }

    #[inline(always)]
    fn load(values: &[f32], at: usize) -> Self {
        let mut out = [0.0; LANES];
        out.copy_from_slice(&values[at..at + LANES]);
        Portable(out)
    }

    #[inline(always)]
    fn load_u8(values: &[u8], at: usize) -> Self {
        let mut out = [0.0; LANES];
        for (x, &v) in out.iter_mut().zip(&values[at..at + LANES]) {
            *x = f32::from(v);
        }
        Portable(out)
    }

    #[inline(always)]
    fn load_u16(values: &[u16], at: usize) -> Self {
        let mut out = [0.0; LANES];
        for (x, &v) in out.iter_mut().zip(&values[at..at + LANES]) {
            *x = f32::from(v);
        }
        Portable(out)
    }

    #[inline(always)]
    fn load_lengths(values: &[u16], at: usize, lengths: Lengths) -> Self {
        let mut out = [0.0; LANES];
        for (x, &code) in out.iter_mut().zip(&values[at..at + LANES]) {
            *x = lengths.length(code);
        }
        Portable(out)
    }

    #[inline(always)]
    fn store(self, values: &mut [f32], at: usize) {
        values[at..at + LANES].copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Portable(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Portable(self.0.map(f32::floor))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn lt(self, other: Self) -> LaneMask {
        self.compare(other, |a, b| a < b)
    }

    #[inline(always)]
    fn le(self, other: Self) -> LaneMask {
        self.compare(other, |a, b| a <= b)
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        let v = self.0;
        ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
    }

    #[inline(always)]
    fn load_index(values: &[u32], at: usize) -> [u32; LANES] {
        let mut out = [0; LANES];
        out.copy_from_slice(&values[at..at + LANES]);
        out
    }

    #[inline(always)]
    fn store_index(index: [u32; LANES], values: &mut [u32], at: usize) {
        values[at..at + LANES].copy_from_slice(&index);
    }

    #[inline(always)]
    fn index_from_array(values: [u32; LANES]) -> [u32; LANES] {
        values
    }

    #[inline(always)]
    fn index_to_array(index: [u32; LANES]) -> [u32; LANES] {
        index
    }

    #[inline(always)]
    fn index_eq(a: [u32; LANES], b: [u32; LANES]) -> LaneMask {
        let mut out = LaneMask([0; LANES]);
        for k in 0..LANES {
            out.0[k] = if a[k] == b[k] { u32::MAX } else { 0 };
        }
        out
    }

    #[inline(always)]
    fn select_index(mask: LaneMask, a: [u32; LANES], b: [u32; LANES]) -> [u32; LANES] {
        let mut out = b;
        for k in 0..LANES {
            out[k] = (a[k] & mask.0[k]) | (b[k] & !mask.0[k]);
        }
        out
    }

    #[inline(always)]
    fn pack_bfloat16(high: Self, low: Self) -> [u32; LANES] {
        let rounded = |x: f32| {
            let bits = x.to_bits();
            bits.wrapping_add(0x7fff + (bits >> 16 & 1))
        };
        let mut out = [0; LANES];
        for k in 0..LANES {
            out[k] = rounded(high.0[k]) & 0xffff_0000 | rounded(low.0[k]) >> 16;
        }
        out
    }

    #[inline(always)]
    fn unpack_bfloat16(words: [u32; LANES]) -> (Self, Self) {
        let (mut high, mut low) = (words, words);
        for k in 0..LANES {
            high[k] &= 0xffff_0000;
            low[k] <<= 16;
        }
        (Portable(high.map(f32::from_bits)), Portable(low.map(f32::from_bits)))
    }

    #[inline(always)]
    fn transpose(records: [&[f32; LANES]; LANES]) -> [Self; LANES] {
        let mut out = [Portable([0.0; LANES]); LANES];
        for (lane, record) in records.iter().enumerate() {
            for k in 0..LANES {
                out[k].0[lane] = record[k];
            }
        }
        out
    }
}

impl Mask<Portable> for LaneMask {
    #[inline(always)]
    fn from_bits(bits: u8) -> LaneMask {
        let mut out = LaneMask([0; LANES]);
        for k in 0..LANES {
            out.0[k] = if bits >> k & 1 != 0 { u32::MAX } else { 0 };
        }
        out
    }

    #[inline(always)]
    fn bits(self) -> u8 {
        let mut bits = 0;
        for k in 0..LANES {
            bits |= ((self.0[k] & 1) as u8) << k;
        }
        bits
    }

    #[inline(always)]
    fn and(self, other: LaneMask) -> LaneMask {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] &= other.0[k];
        }
        out
    }

    #[inline(always)]
    fn and_not(self, other: LaneMask) -> LaneMask {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] &= !other.0[k];
        }
        out
    }

    #[inline(always)]
    fn select(self, a: Portable, b: Portable) -> Portable {
        let mut out = b;
        for k in 0..LANES {
            let bits = (a.0[k].to_bits() & self.0[k]) | (b.0[k].to_bits() & !self.0[k]);
            out.0[k] = f32::from_bits(bits);
        }
        out
    }
}
