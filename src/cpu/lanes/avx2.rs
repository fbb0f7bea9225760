//! AVX2: 256-bit registers. Only to be used inside `dispatch`, which checks the processor first.

use std::arch::x86_64::*;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::{LANES, Lanes, Lengths, Mask};

/// Eight f32.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct Avx2(__m256);

/// Eight truth values: all bits of a lane are set or none.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct LaneMask(__m256);

macro_rules! lanewise {
    ($($trait:ident $method:ident $intrinsic:ident),*) => {$(
        impl $trait for Avx2 {
            type Output = Avx2;
            #[inline(always)]
            fn $method(self, other: Avx2) -> Avx2 {
                // SAFETY: `dispatch` has checked the processor.
                Avx2(unsafe { $intrinsic(self.0, other.0) })
            }
        }
        impl $trait<f32> for Avx2 {
            type Output = Avx2;
            #[inline(always)]
            fn $method(self, other: f32) -> Avx2 {
                self.$method(Avx2::splat(other))
            }
        }
    )*};
}

lanewise!(Add add _mm256_add_ps, Sub sub _mm256_sub_ps, Mul mul _mm256_mul_ps, Div div _mm256_div_ps);

impl AddAssign for Avx2 {
    #[inline(always)]
    fn add_assign(&mut self, other: Avx2) {
        *self = *self + other;
    }
}

impl SubAssign for Avx2 {
    #[inline(always)]
    fn sub_assign(&mut self, other: Avx2) {
        *self = *self - other;
    }
}

impl Neg for Avx2 {
    type Output = Avx2;
    #[inline(always)]
    fn neg(self) -> Avx2 {
        // SAFETY: `dispatch` has checked the processor.
        Avx2(unsafe { _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)) })
    }
}

// SAFETY of all that follows: `dispatch` has checked the processor, and loads and stores go through slices of LANES elements.
impl Lanes for Avx2 {
    type Mask = LaneMask;
    type Index = __m256i;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Avx2(unsafe { _mm256_set1_ps(x) })
    }

    #[inline(always)]
    fn from_array(values: [f32; LANES]) -> Self {
        Avx2(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    fn to_array(self) -> [f32; LANES] {
        let mut out = [0.0; LANES];
        unsafe { _mm256_storeu_ps(out.as_mut_ptr(), self.0) };
        out
    }

    #[inline(always)]
    fn load(values: &[f32], at: usize) -> Self {
        let values = &values[at..at + LANES];
        Avx2(unsafe { _mm256_loadu_ps(values.as_ptr()) })
    }

    #[inline(always)]
    fn load_u8(values: &[u8], at: usize) -> Self {
        let values = &values[at..at + LANES];
        Avx2(unsafe {
            let bytes = _mm_loadl_epi64(values.as_ptr().cast());
            _mm256_cvtepi32_ps(_mm256_cvtepu8_epi32(bytes))
        })
    }

    #[inline(always)]
    fn load_u16(values: &[u16], at: usize) -> Self {
        let values = &values[at..at + LANES];
        Avx2(unsafe { _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(_mm_loadu_si128(values.as_ptr().cast()))) })
    }

    #[inline(always)]
    fn load_lengths(values: &[u16], at: usize, lengths: Lengths) -> Self {
        let values = &values[at..at + LANES];
        Avx2(unsafe {
            let codes = _mm256_cvtepu16_epi32(_mm_loadu_si128(values.as_ptr().cast()));
            let some = _mm256_cmpgt_epi32(codes, _mm256_setzero_si256());
            let shifted = _mm256_sll_epi32(codes, _mm_cvtsi32_si128(lengths.shift as i32));
            let bits = _mm256_add_epi32(shifted, _mm256_set1_epi32(lengths.base as i32));
            _mm256_castsi256_ps(_mm256_and_si256(bits, some))
        })
    }

    #[inline(always)]
    fn store(self, values: &mut [f32], at: usize) {
        let values = &mut values[at..at + LANES];
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self.0) };
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Avx2(unsafe { _mm256_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn floor(self) -> Self {
        Avx2(unsafe { _mm256_floor_ps(self.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Avx2(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Avx2(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn lt(self, other: Self) -> LaneMask {
        LaneMask(unsafe { _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> LaneMask {
        LaneMask(unsafe { _mm256_cmp_ps::<_CMP_LE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn sum(self) -> f32 {
        let v = self.to_array();
        ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
    }

    #[inline(always)]
    fn load_index(values: &[u32], at: usize) -> __m256i {
        let values = &values[at..at + LANES];
        unsafe { _mm256_loadu_si256(values.as_ptr().cast()) }
    }

    #[inline(always)]
    fn store_index(index: __m256i, values: &mut [u32], at: usize) {
        let values = &mut values[at..at + LANES];
        unsafe { _mm256_storeu_si256(values.as_mut_ptr().cast(), index) };
    }

    #[inline(always)]
    fn index_from_array(values: [u32; LANES]) -> __m256i {
        unsafe { _mm256_loadu_si256(values.as_ptr().cast()) }
    }

    #[inline(always)]
    fn index_to_array(index: __m256i) -> [u32; LANES] {
        let mut out = [0; LANES];
        unsafe { _mm256_storeu_si256(out.as_mut_ptr().cast(), index) };
        out
    }

    #[inline(always)]
    fn index_eq(a: __m256i, b: __m256i) -> LaneMask {
        LaneMask(unsafe { _mm256_castsi256_ps(_mm256_cmpeq_epi32(a, b)) })
    }

    #[inline(always)]
    fn select_index(mask: LaneMask, a: __m256i, b: __m256i) -> __m256i {
        unsafe { _mm256_blendv_epi8(b, a, _mm256_castps_si256(mask.0)) }
    }

    #[inline(always)]
    fn pack_bfloat16(high: Self, low: Self) -> __m256i {
        unsafe {
            let rounded = |x: Avx2| {
                let bits = _mm256_castps_si256(x.0);
                let odd = _mm256_and_si256(_mm256_srli_epi32::<16>(bits), _mm256_set1_epi32(1));
                _mm256_add_epi32(bits, _mm256_add_epi32(odd, _mm256_set1_epi32(0x7fff)))
            };
            let low = _mm256_srli_epi32::<16>(rounded(low));
            _mm256_blend_epi16::<0b1010_1010>(low, rounded(high))
        }
    }

    #[inline(always)]
    fn unpack_bfloat16(words: __m256i) -> (Self, Self) {
        unsafe {
            let high = _mm256_and_si256(words, _mm256_set1_epi32(0xffff_0000u32 as i32));
            let low = _mm256_slli_epi32::<16>(words);
            (Avx2(_mm256_castsi256_ps(high)), Avx2(_mm256_castsi256_ps(low)))
        }
    }

    #[inline(always)]
    fn transpose(records: [&[f32; LANES]; LANES]) -> [Self; LANES] {
        unsafe {
            let r = records.map(|record| _mm256_loadu_ps(record.as_ptr()));
            let pair = |a, b| (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let (t0, t1) = pair(r[0], r[1]);
            let (t2, t3) = pair(r[2], r[3]);
            let (t4, t5) = pair(r[4], r[5]);
            let (t6, t7) = pair(r[6], r[7]);
            let s0 = _mm256_shuffle_ps::<0x44>(t0, t2);
            let s1 = _mm256_shuffle_ps::<0xee>(t0, t2);
            let s2 = _mm256_shuffle_ps::<0x44>(t1, t3);
            let s3 = _mm256_shuffle_ps::<0xee>(t1, t3);
            let s4 = _mm256_shuffle_ps::<0x44>(t4, t6);
            let s5 = _mm256_shuffle_ps::<0xee>(t4, t6);
            let s6 = _mm256_shuffle_ps::<0x44>(t5, t7);
            let s7 = _mm256_shuffle_ps::<0xee>(t5, t7);
            [
                Avx2(_mm256_permute2f128_ps::<0x20>(s0, s4)),
                Avx2(_mm256_permute2f128_ps::<0x20>(s1, s5)),
                Avx2(_mm256_permute2f128_ps::<0x20>(s2, s6)),
                Avx2(_mm256_permute2f128_ps::<0x20>(s3, s7)),
                Avx2(_mm256_permute2f128_ps::<0x31>(s0, s4)),
                Avx2(_mm256_permute2f128_ps::<0x31>(s1, s5)),
                Avx2(_mm256_permute2f128_ps::<0x31>(s2, s6)),
                Avx2(_mm256_permute2f128_ps::<0x31>(s3, s7)),
            ]
        }
    }
}

impl Mask<Avx2> for LaneMask {
    #[inline(always)]
    fn from_bits(bits: u8) -> LaneMask {
        LaneMask(unsafe {
            let one = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let spread = _mm256_and_si256(_mm256_set1_epi32(i32::from(bits)), one);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(spread, one))
        })
    }

    #[inline(always)]
    fn bits(self) -> u8 {
        unsafe { _mm256_movemask_ps(self.0) as u8 }
    }

    #[inline(always)]
    fn and(self, other: LaneMask) -> LaneMask {
        LaneMask(unsafe { _mm256_and_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn and_not(self, other: LaneMask) -> LaneMask {
        LaneMask(unsafe { _mm256_andnot_ps(other.0, self.0) })
    }

    #[inline(always)]
    fn select(self, a: Avx2, b: Avx2) -> Avx2 {
        Avx2(unsafe { _mm256_blendv_ps(b.0, a.0, self.0) })
    }
}
