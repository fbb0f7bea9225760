//! Implements lanes with the vectors of `fearless_simd`, which exist for each processor level. Only operations with
//! IEEE 754 rounding are called, never fused, approximate or relaxed ones.

#[cfg(target_arch = "x86_64")]
use fearless_simd::Avx2;
use fearless_simd::prelude::*;
use fearless_simd::{f32x4, f32x8, mask32x8, u8x16, u16x8, u32x8};

use super::{LANES, Lanes, Mask, each, token};
use vrtm_core::grid::codes::Lengths;

/// True if the level's own maximum and minimum are those of x86 processors, which return the second operand if
/// one is NaN.
#[inline(always)]
fn has_x86_order<S: Simd>(level: S) -> bool {
    cfg!(target_arch = "x86_64") && !level.level().is_fallback()
}

/// `values[at..at + LANES]` as u32.
#[inline(always)]
fn codes<S: Simd>(values: &[u16], at: usize) -> u32x8<S> {
    widened(u16x8::from_slice(token::<S>(), &values[at..at + LANES]))
}

#[inline(always)]
fn widened<S: Simd>(codes: u16x8<S>) -> u32x8<S> {
    // The contents of the long vector's other half do not matter.
    codes.simd.widen_u16x16(codes.simd.combine_u16x8(codes, codes)).0
}

#[inline(always)]
fn floats<S: Simd>(codes: u32x8<S>) -> f32x8<S> {
    // Some levels have no conversion from unsigned numbers.
    codes.simd.cvt_f32_i32x8(codes.bitcast())
}

impl<S: Simd> Lanes for f32x8<S> {
    type Mask = mask32x8<S>;
    type Index = u32x8<S>;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        SimdBase::splat(token::<S>(), x)
    }

    #[inline(always)]
    fn from_array(values: [f32; LANES]) -> Self {
        Self::simd_from(token::<S>(), values)
    }

    #[inline(always)]
    fn to_array(self) -> [f32; LANES] {
        self.into()
    }

    #[inline(always)]
    fn load(values: &[f32], at: usize) -> Self {
        Self::from_slice(token::<S>(), &values[at..at + LANES])
    }

    #[inline(always)]
    fn load_u8(values: &[u8], at: usize) -> Self {
        let mut bytes = [0; 2 * LANES];
        bytes[..LANES].copy_from_slice(&values[at..at + LANES]);
        let bytes = u8x16::simd_from(token::<S>(), bytes);
        floats(widened(bytes.simd.widen_u8x16(bytes).0))
    }

    #[inline(always)]
    fn load_u16(values: &[u16], at: usize) -> Self {
        floats(codes(values, at))
    }

    #[inline(always)]
    fn load_lengths(values: &[u16], at: usize, lengths: Lengths) -> Self {
        let codes = codes::<S>(values, at);
        let zero = u32x8::splat(codes.simd, 0);
        let bits = (codes << lengths.shift) + lengths.base;
        codes.simd.select_u32x8(codes.simd_eq(zero), zero, bits).bitcast()
    }

    #[inline(always)]
    fn store(self, values: &mut [f32], at: usize) {
        self.store_slice(&mut values[at..at + LANES]);
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.simd.sqrt_f32x8(self)
    }

    #[inline(always)]
    fn floor(self) -> Self {
        self.simd.floor_f32x8(self)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if has_x86_order(self.simd) {
            return self.simd.max_f32x8(self, other);
        }
        self.simd.select_f32x8(self.simd.simd_gt_f32x8(self, other), self, other)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if has_x86_order(self.simd) {
            return self.simd.min_f32x8(self, other);
        }
        self.simd.select_f32x8(self.simd.simd_lt_f32x8(self, other), self, other)
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Self::Mask {
        self.simd.simd_lt_f32x8(self, other)
    }

    #[inline(always)]
    fn le(self, other: Self) -> Self::Mask {
        self.simd.simd_le_f32x8(self, other)
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        let v = Lanes::to_array(self);
        ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
    }

    #[inline(always)]
    fn load_index(values: &[u32], at: usize) -> u32x8<S> {
        u32x8::from_slice(token::<S>(), &values[at..at + LANES])
    }

    #[inline(always)]
    fn store_index(index: u32x8<S>, values: &mut [u32], at: usize) {
        index.store_slice(&mut values[at..at + LANES]);
    }

    #[inline(always)]
    fn index_from_array(values: [u32; LANES]) -> u32x8<S> {
        u32x8::simd_from(token::<S>(), values)
    }

    #[inline(always)]
    fn index_to_array(index: u32x8<S>) -> [u32; LANES] {
        index.into()
    }

    #[inline(always)]
    fn index_eq(a: u32x8<S>, b: u32x8<S>) -> Self::Mask {
        a.simd_eq(b)
    }

    #[inline(always)]
    fn select_index(mask: Self::Mask, a: u32x8<S>, b: u32x8<S>) -> u32x8<S> {
        a.simd.select_u32x8(mask, a, b)
    }

    #[inline(always)]
    fn bits(self) -> u32x8<S> {
        self.bitcast()
    }

    #[inline(always)]
    fn from_bits(bits: u32x8<S>) -> Self {
        bits.bitcast()
    }

    #[inline(always)]
    fn pack_two(x: Self, y: Self) -> u32x8<S> {
        // What is left of a sum that cancels must not decide how x is rounded: its sign may differ on a GPU.
        let is_nil = (y * y).le(x * x * (1.0 / (1u64 << 36) as f32));
        let y = Mask::select(is_nil, Self::zero(), y);
        let bits: u32x8<S> = y.bitcast();
        let low = (bits + (((bits >> 16) & 1) + 0x7fff)) >> 16;
        let bits: u32x8<S> = x.bitcast();
        let whole = ((bits - low + 0x8000) & 0xffff_0000) | low;
        // The lower half alone is a denormal number, which stands for 0.
        Self::select_index((x * x).le(Self::zero()), low, whole)
    }

    #[inline(always)]
    fn unpack_two(words: u32x8<S>) -> [Self; 2] {
        [words.bitcast(), (words << 16).bitcast()]
    }

    #[inline(always)]
    fn transpose(records: [&[f32; LANES]; LANES]) -> [Self; LANES] {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = token::<S>().level().as_avx2() {
            let rows = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| f32x8::simd_from(avx2, *records[k]));
            let columns = transposed(avx2, rows);
            return each!([0, 1, 2, 3, 4, 5, 6, 7], |k| Self::from_array(columns[k].into()));
        }
        // The off-diagonal quarters are swapped.
        let (low, low_right) = (quarter::<S>(&records, 0, 0), quarter::<S>(&records, 4, 0));
        let (high, high_right) = (quarter::<S>(&records, 0, 4), quarter::<S>(&records, 4, 4));
        let [a, b, c, d] = each!([0, 1, 2, 3], |k| token::<S>().combine_f32x4(low[k], low_right[k]));
        let [e, f, g, h] = each!([0, 1, 2, 3], |k| token::<S>().combine_f32x4(high[k], high_right[k]));
        [a, b, c, d, e, f, g, h]
    }
}

/// Four numbers of four records, transposed.
#[inline(always)]
fn quarter<S: Simd>(records: &[&[f32; LANES]; LANES], row: usize, column: usize) -> [f32x4<S>; 4] {
    let simd = token::<S>();
    let r = each!([0, 1, 2, 3], |k| f32x4::from_slice(simd, &records[row + k][column..column + 4]));
    let [(a, b), (c, d)] = each!([0, 1], |k| simd.interleave_f32x4(r[k], r[k + 2]));
    let ((a, c), (b, d)) = (simd.interleave_f32x4(a, c), simd.interleave_f32x4(b, d));
    [a, c, b, d]
}

/// Transposes eight records in half as many instructions as with four quarters, since these shuffles work on both
/// halves of a register. A kernel of `fearless_simd` would not always be inlined.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn transposed(avx2: Avx2, rows: [f32x8<Avx2>; LANES]) -> [f32x8<Avx2>; LANES] {
    use std::arch::x86_64::*;
    // SAFETY: the token stands for a processor that has AVX2.
    unsafe {
        let r = each!([0, 1, 2, 3, 4, 5, 6, 7], |k| __m256::from(rows[k]));
        let low = each!([0, 2, 4, 6], |k| _mm256_unpacklo_ps(r[k], r[k + 1]));
        let high = each!([0, 2, 4, 6], |k| _mm256_unpackhi_ps(r[k], r[k + 1]));
        let [a0, a4] = each!([0, 2], |k| _mm256_shuffle_ps::<0x44>(low[k], low[k + 1]));
        let [b0, b4] = each!([0, 2], |k| _mm256_shuffle_ps::<0xee>(low[k], low[k + 1]));
        let [c0, c4] = each!([0, 2], |k| _mm256_shuffle_ps::<0x44>(high[k], high[k + 1]));
        let [d0, d4] = each!([0, 2], |k| _mm256_shuffle_ps::<0xee>(high[k], high[k + 1]));
        let columns = [
            _mm256_permute2f128_ps::<0x20>(a0, a4),
            _mm256_permute2f128_ps::<0x20>(b0, b4),
            _mm256_permute2f128_ps::<0x20>(c0, c4),
            _mm256_permute2f128_ps::<0x20>(d0, d4),
            _mm256_permute2f128_ps::<0x31>(a0, a4),
            _mm256_permute2f128_ps::<0x31>(b0, b4),
            _mm256_permute2f128_ps::<0x31>(c0, c4),
            _mm256_permute2f128_ps::<0x31>(d0, d4),
        ];
        each!([0, 1, 2, 3, 4, 5, 6, 7], |k| columns[k].simd_into(avx2))
    }
}

impl<S: Simd> Mask<f32x8<S>> for mask32x8<S> {
    #[inline(always)]
    fn from_bits(bits: u8) -> Self {
        Self::from_bitmask(token::<S>(), bits.into())
    }

    #[inline(always)]
    fn bits(self) -> u8 {
        self.to_bitmask() as u8
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self & other
    }

    #[inline(always)]
    fn and_not(self, other: Self) -> Self {
        self & !other
    }

    #[inline(always)]
    fn select(self, a: f32x8<S>, b: f32x8<S>) -> f32x8<S> {
        a.simd.select_f32x8(self, a, b)
    }

    #[inline(always)]
    fn any(self) -> bool {
        self.any_true()
    }
}
