//! SSE2, which every 64-bit x86 processor has: two 128-bit registers for eight lanes.

use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::{LANES, Lanes, Lengths, Mask};

/// Eight f32: lanes 0 to 3, then 4 to 7.
#[derive(Clone, Copy, Debug)]
pub struct Sse2(__m128, __m128);

/// Eight truth values: all bits of a lane are set or none.
#[derive(Clone, Copy, Debug)]
pub struct LaneMask(__m128, __m128);

// SAFETY of all that follows: the target always has SSE2, and loads and stores go through slices of LANES elements.

macro_rules! lanewise {
    ($($trait:ident $method:ident $intrinsic:ident),*) => {$(
        impl $trait for Sse2 {
            type Output = Sse2;
            #[inline(always)]
            fn $method(self, other: Sse2) -> Sse2 {
                unsafe { Sse2($intrinsic(self.0, other.0), $intrinsic(self.1, other.1)) }
            }
        }
        impl $trait<f32> for Sse2 {
            type Output = Sse2;
            #[inline(always)]
            fn $method(self, other: f32) -> Sse2 {
                self.$method(Sse2::splat(other))
            }
        }
    )*};
}

lanewise!(Add add _mm_add_ps, Sub sub _mm_sub_ps, Mul mul _mm_mul_ps, Div div _mm_div_ps);

impl AddAssign for Sse2 {
    #[inline(always)]
    fn add_assign(&mut self, other: Sse2) {
        *self = *self + other;
    }
}

impl SubAssign for Sse2 {
    #[inline(always)]
    fn sub_assign(&mut self, other: Sse2) {
        *self = *self - other;
    }
}

impl Neg for Sse2 {
    type Output = Sse2;
    #[inline(always)]
    fn neg(self) -> Sse2 {
        unsafe {
            let sign = _mm_set1_ps(-0.0);
            Sse2(_mm_xor_ps(self.0, sign), _mm_xor_ps(self.1, sign))
        }
    }
}

/// Where the mask is true `a`, elsewhere `b`.
#[inline(always)]
unsafe fn choose(mask: __m128, a: __m128, b: __m128) -> __m128 {
    unsafe { _mm_or_ps(_mm_and_ps(mask, a), _mm_andnot_ps(mask, b)) }
}

impl Lanes for Sse2 {
    type Mask = LaneMask;
    type Index = [__m128i; 2];

    #[inline(always)]
    fn splat(x: f32) -> Self {
        let x = unsafe { _mm_set1_ps(x) };
        Sse2(x, x)
    }

    #[inline(always)]
    fn from_array(values: [f32; LANES]) -> Self {
        Self::load(&values, 0)
    }

    #[inline(always)]
    fn to_array(self) -> [f32; LANES] {
        let mut out = [0.0; LANES];
        self.store(&mut out, 0);
        out
    }

    #[inline(always)]
    fn load(values: &[f32], at: usize) -> Self {
        let values = &values[at..at + LANES];
        unsafe { Sse2(_mm_loadu_ps(values.as_ptr()), _mm_loadu_ps(values.as_ptr().add(4))) }
    }

    #[inline(always)]
    fn load_u8(values: &[u8], at: usize) -> Self {
        let values = &values[at..at + LANES];
        unsafe {
            let zero = _mm_setzero_si128();
            let words = _mm_unpacklo_epi8(_mm_loadl_epi64(values.as_ptr().cast()), zero);
            Sse2(
                _mm_cvtepi32_ps(_mm_unpacklo_epi16(words, zero)),
                _mm_cvtepi32_ps(_mm_unpackhi_epi16(words, zero)),
            )
        }
    }

    #[inline(always)]
    fn load_u16(values: &[u16], at: usize) -> Self {
        let values = &values[at..at + LANES];
        unsafe {
            let (zero, codes) = (_mm_setzero_si128(), _mm_loadu_si128(values.as_ptr().cast()));
            Sse2(
                _mm_cvtepi32_ps(_mm_unpacklo_epi16(codes, zero)),
                _mm_cvtepi32_ps(_mm_unpackhi_epi16(codes, zero)),
            )
        }
    }

    #[inline(always)]
    fn load_lengths(values: &[u16], at: usize, lengths: Lengths) -> Self {
        let values = &values[at..at + LANES];
        unsafe {
            let (zero, codes) = (_mm_setzero_si128(), _mm_loadu_si128(values.as_ptr().cast()));
            let length = |codes: __m128i| {
                let some = _mm_cmpgt_epi32(codes, zero);
                let shifted = _mm_sll_epi32(codes, _mm_cvtsi32_si128(lengths.shift as i32));
                let bits = _mm_add_epi32(shifted, _mm_set1_epi32(lengths.base as i32));
                _mm_castsi128_ps(_mm_and_si128(bits, some))
            };
            Sse2(length(_mm_unpacklo_epi16(codes, zero)), length(_mm_unpackhi_epi16(codes, zero)))
        }
    }

    #[inline(always)]
    fn store(self, values: &mut [f32], at: usize) {
        let values = &mut values[at..at + LANES];
        unsafe {
            _mm_storeu_ps(values.as_mut_ptr(), self.0);
            _mm_storeu_ps(values.as_mut_ptr().add(4), self.1);
        }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        unsafe { Sse2(_mm_sqrt_ps(self.0), _mm_sqrt_ps(self.1)) }
    }

    #[inline(always)]
    fn floor(self) -> Self {
        // There is no such instruction yet.
        let mut values = self.to_array();
        for x in &mut values {
            *x = x.floor();
        }
        Self::from_array(values)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        unsafe { Sse2(_mm_max_ps(self.0, other.0), _mm_max_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        unsafe { Sse2(_mm_min_ps(self.0, other.0), _mm_min_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> LaneMask {
        unsafe { LaneMask(_mm_cmplt_ps(self.0, other.0), _mm_cmplt_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn le(self, other: Self) -> LaneMask {
        unsafe { LaneMask(_mm_cmple_ps(self.0, other.0), _mm_cmple_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        let v = self.to_array();
        ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
    }

    #[inline(always)]
    fn load_index(values: &[u32], at: usize) -> [__m128i; 2] {
        let values = &values[at..at + LANES];
        unsafe {
            let at: *const __m128i = values.as_ptr().cast();
            [_mm_loadu_si128(at), _mm_loadu_si128(at.add(1))]
        }
    }

    #[inline(always)]
    fn store_index(index: [__m128i; 2], values: &mut [u32], at: usize) {
        let values = &mut values[at..at + LANES];
        unsafe {
            let at: *mut __m128i = values.as_mut_ptr().cast();
            _mm_storeu_si128(at, index[0]);
            _mm_storeu_si128(at.add(1), index[1]);
        }
    }

    #[inline(always)]
    fn index_from_array(values: [u32; LANES]) -> [__m128i; 2] {
        Self::load_index(&values, 0)
    }

    #[inline(always)]
    fn index_to_array(index: [__m128i; 2]) -> [u32; LANES] {
        let mut out = [0; LANES];
        Self::store_index(index, &mut out, 0);
        out
    }

    #[inline(always)]
    fn index_eq(a: [__m128i; 2], b: [__m128i; 2]) -> LaneMask {
        unsafe {
            LaneMask(
                _mm_castsi128_ps(_mm_cmpeq_epi32(a[0], b[0])),
                _mm_castsi128_ps(_mm_cmpeq_epi32(a[1], b[1])),
            )
        }
    }

    #[inline(always)]
    fn select_index(mask: LaneMask, a: [__m128i; 2], b: [__m128i; 2]) -> [__m128i; 2] {
        unsafe {
            let half = |mask: __m128, a: __m128i, b: __m128i| {
                _mm_castps_si128(choose(mask, _mm_castsi128_ps(a), _mm_castsi128_ps(b)))
            };
            [half(mask.0, a[0], b[0]), half(mask.1, a[1], b[1])]
        }
    }

    #[inline(always)]
    fn pack_bfloat16(high: Self, low: Self) -> [__m128i; 2] {
        unsafe {
            let rounded = |x: __m128| {
                let bits = _mm_castps_si128(x);
                let odd = _mm_and_si128(_mm_srli_epi32::<16>(bits), _mm_set1_epi32(1));
                _mm_add_epi32(bits, _mm_add_epi32(odd, _mm_set1_epi32(0x7fff)))
            };
            let word = |high: __m128, low: __m128| {
                let high = _mm_and_si128(rounded(high), _mm_set1_epi32(0xffff_0000u32 as i32));
                _mm_or_si128(high, _mm_srli_epi32::<16>(rounded(low)))
            };
            [word(high.0, low.0), word(high.1, low.1)]
        }
    }

    #[inline(always)]
    fn unpack_bfloat16(words: [__m128i; 2]) -> (Self, Self) {
        unsafe {
            let mask = _mm_set1_epi32(0xffff_0000u32 as i32);
            let [high, low] = [words.map(|w| _mm_and_si128(w, mask)), words.map(|w| _mm_slli_epi32::<16>(w))]
                .map(|[a, b]| Sse2(_mm_castsi128_ps(a), _mm_castsi128_ps(b)));
            (high, low)
        }
    }

    #[inline(always)]
    fn transpose(records: [&[f32; LANES]; LANES]) -> [Self; LANES] {
        // Four 4x4 blocks; the ones off the diagonal change places.
        let quarter = |rows: usize, at: usize| unsafe {
            let [mut a, mut b, mut c, mut d] =
                [0, 1, 2, 3].map(|k| _mm_loadu_ps(records[rows + k].as_ptr().add(at)));
            _MM_TRANSPOSE4_PS(&mut a, &mut b, &mut c, &mut d);
            [a, b, c, d]
        };
        let (low, low_right) = (quarter(0, 0), quarter(4, 0));
        let (high, high_right) = (quarter(0, 4), quarter(4, 4));
        [
            Sse2(low[0], low_right[0]),
            Sse2(low[1], low_right[1]),
            Sse2(low[2], low_right[2]),
            Sse2(low[3], low_right[3]),
            Sse2(high[0], high_right[0]),
            Sse2(high[1], high_right[1]),
            Sse2(high[2], high_right[2]),
            Sse2(high[3], high_right[3]),
        ]
    }
}

impl Mask<Sse2> for LaneMask {
    #[inline(always)]
    fn from_bits(bits: u8) -> LaneMask {
        unsafe {
            let half = |one: __m128i| {
                let spread = _mm_and_si128(_mm_set1_epi32(i32::from(bits)), one);
                _mm_castsi128_ps(_mm_cmpeq_epi32(spread, one))
            };
            LaneMask(half(_mm_setr_epi32(1, 2, 4, 8)), half(_mm_setr_epi32(16, 32, 64, 128)))
        }
    }

    #[inline(always)]
    fn bits(self) -> u8 {
        unsafe { (_mm_movemask_ps(self.0) | _mm_movemask_ps(self.1) << 4) as u8 }
    }

    #[inline(always)]
    fn and(self, other: LaneMask) -> LaneMask {
        unsafe { LaneMask(_mm_and_ps(self.0, other.0), _mm_and_ps(self.1, other.1)) }
    }

    #[inline(always)]
    fn and_not(self, other: LaneMask) -> LaneMask {
        unsafe { LaneMask(_mm_andnot_ps(other.0, self.0), _mm_andnot_ps(other.1, self.1)) }
    }

    #[inline(always)]
    fn select(self, a: Sse2, b: Sse2) -> Sse2 {
        unsafe { Sse2(choose(self.0, a.0, b.0), choose(self.1, a.1, b.1)) }
    }
}
