//! Eight f32 lanes: one row of one colour of a block. Every processor level gives the same bits, because only + - * /
//! and square roots are used, without fused multiply-add.

mod vector;

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};
use std::ptr::NonNull;

#[cfg(target_arch = "x86_64")]
use fearless_simd::Avx2;
#[cfg(not(any(
    all(any(target_arch = "x86", target_arch = "x86_64"), target_feature = "sse2", target_feature = "fxsr"),
    all(target_arch = "aarch64", target_feature = "neon"),
    all(target_arch = "wasm32", target_feature = "simd128")
)))]
use fearless_simd::Fallback as Baseline;
#[cfg(all(target_arch = "aarch64", target_feature = "neon"))]
use fearless_simd::Neon as Baseline;
#[cfg(all(
    any(target_arch = "x86", target_arch = "x86_64"),
    target_feature = "sse2",
    target_feature = "fxsr"
))]
use fearless_simd::Sse2 as Baseline;
#[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
use fearless_simd::WasmSimd128 as Baseline;
use fearless_simd::{Simd, f32x8};

use vrtm_core::grid::codes::Lengths;

/// Plain loops over arrays, which define the results of all levels.
#[cfg(test)]
pub type Portable = f32x8<fearless_simd::Fallback>;

/// Lanes per vector.
pub const LANES: usize = 8;

/// Eight f32, in the representation of one processor level.
pub trait Lanes:
    Copy
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Mul<f32, Output = Self>
    + Add<f32, Output = Self>
    + 'static
{
    /// Eight truth values.
    type Mask: Mask<Self>;
    /// Eight u32.
    type Index: Copy + Send + Sync;

    fn splat(x: f32) -> Self;
    fn from_array(values: [f32; LANES]) -> Self;
    fn to_array(self) -> [f32; LANES];
    /// `values[at..at + LANES]`.
    fn load(values: &[f32], at: usize) -> Self;
    /// Loads eight u8 as floats.
    fn load_u8(values: &[u8], at: usize) -> Self;
    /// Loads eight u16 as floats.
    fn load_u16(values: &[u16], at: usize) -> Self;
    /// Loads codes and decodes them to lengths.
    fn load_lengths(values: &[u16], at: usize, lengths: Lengths) -> Self;
    fn store(self, values: &mut [f32], at: usize);
    fn sqrt(self) -> Self;
    fn floor(self) -> Self;
    /// The lane-wise maximum; where this operand is NaN, the other one.
    fn max(self, other: Self) -> Self;
    /// The lane-wise minimum; where this operand is NaN, the other one.
    fn min(self, other: Self) -> Self;
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    /// The sum of the lanes, in a fixed order.
    fn sum(self) -> f32;

    fn load_index(values: &[u32], at: usize) -> Self::Index;
    fn store_index(index: Self::Index, values: &mut [u32], at: usize);
    fn index_from_array(values: [u32; LANES]) -> Self::Index;
    fn index_to_array(index: Self::Index) -> [u32; LANES];
    fn index_eq(a: Self::Index, b: Self::Index) -> Self::Mask;
    /// `a` where the mask is true, `b` elsewhere.
    fn select_index(mask: Self::Mask, a: Self::Index, b: Self::Index) -> Self::Index;
    fn bits(self) -> Self::Index;
    fn from_bits(bits: Self::Index) -> Self;
    /// Words with two numbers each (method §7.2): the lower half is `y` as bfloat16 (rounded to even in a tie; a NaN
    /// may become a number or infinity), the upper half such that the whole word as f32 is next to `x`.
    fn pack_two(x: Self, y: Self) -> Self::Index;
    /// The operands of `pack_two`, as it rounded them.
    fn unpack_two(words: Self::Index) -> [Self; 2];
    /// Transposes eight records of eight numbers: lane n of `out[k]` is the k-th number of record n.
    fn transpose(records: [&[f32; LANES]; LANES]) -> [Self; LANES];

    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    #[inline(always)]
    fn one() -> Self {
        Self::splat(1.0)
    }
}

/// Eight truth values, which select lanes.
pub trait Mask<V>: Copy {
    /// Lane k is true if bit k is set.
    fn from_bits(bits: u8) -> Self;
    fn bits(self) -> u8;
    fn and(self, other: Self) -> Self;
    /// True in lanes where this mask is true and the other one is false.
    fn and_not(self, other: Self) -> Self;
    /// `a` where the mask is true, `b` elsewhere.
    fn select(self, a: V, b: V) -> V;
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// Work on a block. `run` must be `#[inline(always)]`, so that it can be compiled for several processor levels.
pub trait Vectorised {
    type Output;
    fn run<V: Lanes>(self) -> Self::Output;
}

/// Runs a kernel compiled for the widest vectors that this processor has. Every level gives the same bits: none of them
/// fuses a multiplication with an addition.
#[inline(always)]
pub fn dispatch<K: Vectorised>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        // Must list everything that `fearless_simd` requires of AVX2, and AVX-512; otherwise its functions are called
        // instead of inlined.
        #[cfg(avx512)]
        #[target_feature(enable = "avx2,bmi1,bmi2,cmpxchg16b,f16c,fma,fxsr,lzcnt,movbe,popcnt,xsave")]
        #[target_feature(enable = "avx512f,avx512vl,avx512bw,avx512dq")]
        fn avx512<K: Vectorised>(kernel: K) -> K::Output {
            kernel.run::<f32x8<Avx2>>()
        }
        // A separate function: inlined, its variables would take up stack in each of the others.
        #[inline(never)]
        fn baseline<K: Vectorised>(kernel: K) -> K::Output {
            kernel.run::<f32x8<Baseline>>()
        }
        match processor_level() {
            // SAFETY: the processor has this level.
            #[cfg(avx512)]
            ProcessorLevel::Avx512 => unsafe { avx512(kernel) },
            ProcessorLevel::Avx2 => token::<Avx2>().vectorize(
                #[inline(always)]
                || kernel.run::<f32x8<Avx2>>(),
            ),
            ProcessorLevel::Baseline => baseline(kernel),
        }
    }
    #[cfg(not(target_arch = "x86_64"))]
    kernel.run::<f32x8<Baseline>>()
}

/// The token of a level: a zero-sized value that shows that the processor has the level's instructions.
#[inline(always)]
fn token<S: Simd>() -> S {
    const { assert!(size_of::<S>() == 0) };
    // SAFETY: the value has no bytes, so nothing is read. Its claim is true, because only `dispatch` chooses a level,
    // and it checks the processor first.
    unsafe { NonNull::<S>::dangling().read() }
}

/// Processor levels that kernels are compiled for.
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))] // Processors other than x86-64 have one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum ProcessorLevel {
    /// The minimum of the target: SSE2, NEON, WebAssembly's vectors, or what the compiler makes of plain loops.
    Baseline,
    /// AVX2, and the bit-manipulation instructions of processors that have it.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// Vectors of eight lanes as with AVX2, but 32 registers instead of 16: a solve takes 6 % fewer instructions, since
    /// fewer values are spilled. Only in release builds (build.rs).
    #[cfg(all(target_arch = "x86_64", avx512))]
    Avx512,
}

/// The level in use: the highest that the processor has.
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))] // Processors other than x86-64 have one level.
#[inline(always)]
pub fn processor_level() -> ProcessorLevel {
    #[cfg(any(test, feature = "lab"))]
    return detected().min(forced::most());
    #[cfg(not(any(test, feature = "lab")))]
    detected()
}

#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code))] // Processors other than x86-64 have one level.
#[inline(always)]
fn detected() -> ProcessorLevel {
    #[cfg(target_arch = "x86_64")]
    {
        #[cfg(avx512)]
        use std::arch::is_x86_feature_detected as has;
        if fearless_simd::Level::new().as_avx2().is_some() {
            #[cfg(avx512)]
            if has!("avx512f") && has!("avx512vl") && has!("avx512bw") && has!("avx512dq") {
                return ProcessorLevel::Avx512;
            }
            return ProcessorLevel::Avx2;
        }
    }
    ProcessorLevel::Baseline
}

/// Lets tests and benches run solves on lower levels.
#[cfg(any(test, feature = "lab"))]
pub mod forced {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::ProcessorLevel;

    /// All levels, lowest first.
    pub const LEVELS: &[ProcessorLevel] = &[
        ProcessorLevel::Baseline,
        #[cfg(target_arch = "x86_64")]
        ProcessorLevel::Avx2,
        #[cfg(all(target_arch = "x86_64", avx512))]
        ProcessorLevel::Avx512,
    ];

    static MOST: AtomicUsize = AtomicUsize::new(LEVELS.len() - 1);

    pub fn most() -> ProcessorLevel {
        LEVELS[MOST.load(Ordering::Relaxed)]
    }

    /// Runs `f` on `level` or a lower one. Other tests that run at the same time may also use lower levels; they get
    /// the same bits.
    pub fn at_most<R>(level: ProcessorLevel, f: impl FnOnce() -> R) -> R {
        MOST.store(level as usize, Ordering::Relaxed);
        let result = f();
        MOST.store(LEVELS.len() - 1, Ordering::Relaxed);
        result
    }
}

/// An array of the values of an expression, one for each of the given numbers. Unlike `map`, it compiles to no call.
macro_rules! each {
    ([$($n:literal),*], |$k:ident| $value:expr) => {
        [$({ let $k: usize = $n; $value }),*]
    };
}
pub(crate) use each;

#[cfg(test)]
mod tests;
