//! Eight f32 lanes: one row of one colour of a block. Every processor level gives the same bits, because only + - * /
//! and square roots are used and nothing is contracted.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod portable;

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

pub use portable::Portable;

/// Lanes per vector.
pub const LANES: usize = 8;

/// Eight f32, as one processor level holds them.
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
    type Mask: Truth<Self>;
    /// Eight u32.
    type Index: Copy + Send + Sync;

    fn splat(x: f32) -> Self;
    fn from_array(values: [f32; LANES]) -> Self;
    fn to_array(self) -> [f32; LANES];
    /// `values[at..at + LANES]`.
    fn load(values: &[f32], at: usize) -> Self;
    /// 0 and 1 as floats.
    fn load_u8(values: &[u8], at: usize) -> Self;
    fn store(self, values: &mut [f32], at: usize);
    fn sqrt(self) -> Self;
    fn floor(self) -> Self;
    /// The other operand where this one is not a number.
    fn max(self, other: Self) -> Self;
    /// The other operand where this one is not a number.
    fn min(self, other: Self) -> Self;
    fn lt(self, other: Self) -> Self::Mask;
    fn le(self, other: Self) -> Self::Mask;
    /// The sum of the lanes, in a fixed order.
    fn sum(self) -> f32;

    fn load_index(values: &[u32], at: usize) -> Self::Index;
    fn store_index(index: Self::Index, values: &mut [u32], at: usize);
    fn index_from(values: [u32; LANES]) -> Self::Index;
    fn index_array(index: Self::Index) -> [u32; LANES];
    fn same(a: Self::Index, b: Self::Index) -> Self::Mask;
    /// Where the mask is true `a`, elsewhere `b`.
    fn select_index(mask: Self::Mask, a: Self::Index, b: Self::Index) -> Self::Index;
    /// Numbers at the same place of eight records: `out[k]` has in lane n the k-th number of record n.
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

/// Eight truth values, and what they choose.
pub trait Truth<V>: Copy {
    /// Lane k is true if bit k is set.
    fn from_bits(bits: u8) -> Self;
    fn bits(self) -> u8;
    fn and(self, other: Self) -> Self;
    /// True in lanes where this is and the other one is not.
    fn and_not(self, other: Self) -> Self;
    /// `a` where true, `b` elsewhere.
    fn select(self, a: V, b: V) -> V;
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// Work on a block, whose `run` is to be inlined (always) so that it can be compiled for several processors.
pub trait Kernel {
    type Output;
    fn run<V: Lanes>(self) -> Self::Output;
}

/// Runs a kernel that was compiled for the widest vectors that this processor has. Every level gives the same bits: none
/// of them fuses a multiplication with an addition.
#[inline(always)]
pub fn wide<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2,bmi1,bmi2,popcnt,lzcnt")]
        unsafe fn avx2<K: Kernel>(kernel: K) -> K::Output {
            kernel.run::<avx2::Avx2>()
        }
        if level() == Level::Avx2 {
            // SAFETY: the processor has it.
            return unsafe { avx2(kernel) };
        }
    }
    kernel.run::<Portable>()
}

/// Processor levels that kernels are compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// Whatever the target has at least.
    Portable,
    /// AVX2, and the bit instructions of processors that have it.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

/// The level in use: the highest that the processor has.
#[inline(always)]
pub fn level() -> Level {
    #[cfg(target_arch = "x86_64")]
    {
        #[cfg(test)]
        if forced::is_portable() {
            return Level::Portable;
        }
        if std::arch::is_x86_feature_detected!("avx2")
            && std::arch::is_x86_feature_detected!("bmi1")
            && std::arch::is_x86_feature_detected!("bmi2")
            && std::arch::is_x86_feature_detected!("popcnt")
            && std::arch::is_x86_feature_detected!("lzcnt")
        {
            return Level::Avx2;
        }
    }
    Level::Portable
}

/// Tests run solves on the lower level, too.
#[cfg(test)]
pub mod forced {
    use std::sync::atomic::{AtomicBool, Ordering};

    static PORTABLE: AtomicBool = AtomicBool::new(false);

    pub fn is_portable() -> bool {
        PORTABLE.load(Ordering::Relaxed)
    }

    /// Runs `f` without special instructions. Other tests that run meanwhile may do without them, too: the bits are the
    /// same.
    pub fn portable<R>(f: impl FnOnce() -> R) -> R {
        PORTABLE.store(true, Ordering::Relaxed);
        let result = f();
        PORTABLE.store(false, Ordering::Relaxed);
        result
    }
}

/// An array of the values of an expression for each of some numbers. Unlike `map`, it leaves no call behind.
macro_rules! each {
    ([$($n:literal),*], |$k:ident| $value:expr) => {
        [$({ let $k: usize = $n; $value }),*]
    };
}
pub(crate) use each;

#[cfg(test)]
mod tests;
