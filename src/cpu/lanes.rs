//! Eight f32 lanes: one row of one colour of a block. Plain loops over arrays, which the compiler turns into vector
//! instructions of whatever level is enabled; every level gives the same bits, because only + - * / and sqrt are
//! used and nothing is contracted.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Lanes per vector.
pub const LANES: usize = 8;

/// Eight f32.
#[derive(Clone, Copy, Debug, Default)]
#[repr(C, align(32))]
pub struct V(pub [f32; LANES]);

/// Work on a block, whose `run` is to be inlined (always) so that it can be compiled for several processors.
pub trait Kernel {
    type Output;
    fn run(self) -> Self::Output;
}

/// Runs a kernel that was compiled for the widest vectors that this processor has. Every level gives the same bits: none
/// of them fuses a multiplication with an addition.
#[inline(always)]
pub fn wide<K: Kernel>(kernel: K) -> K::Output {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        unsafe fn avx2<K: Kernel>(kernel: K) -> K::Output {
            kernel.run()
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has it.
            return unsafe { avx2(kernel) };
        }
    }
    kernel.run()
}

/// An array of the values of an expression for each of some numbers. Unlike `map`, it leaves no call behind.
macro_rules! each {
    ([$($n:literal),*], |$k:ident| $value:expr) => {
        [$({ let $k: usize = $n; $value }),*]
    };
}
pub(crate) use each;

/// Eight truth values.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub struct Mask(pub [u32; LANES]);

macro_rules! lanewise {
    ($($trait:ident $method:ident $op:tt),*) => {$(
        impl $trait for V {
            type Output = V;
            #[inline(always)]
            fn $method(self, other: V) -> V {
                let mut out = self;
                for k in 0..LANES {
                    out.0[k] = self.0[k] $op other.0[k];
                }
                out
            }
        }
        impl $trait<f32> for V {
            type Output = V;
            #[inline(always)]
            fn $method(self, other: f32) -> V {
                self $op V::splat(other)
            }
        }
    )*};
}

lanewise!(Add add +, Sub sub -, Mul mul *, Div div /);

impl AddAssign for V {
    #[inline(always)]
    fn add_assign(&mut self, other: V) {
        *self = *self + other;
    }
}

impl SubAssign for V {
    #[inline(always)]
    fn sub_assign(&mut self, other: V) {
        *self = *self - other;
    }
}

impl Neg for V {
    type Output = V;
    #[inline(always)]
    fn neg(self) -> V {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] = -self.0[k];
        }
        out
    }
}

impl V {
    pub const ZERO: V = V([0.0; LANES]);
    pub const ONE: V = V([1.0; LANES]);

    #[inline(always)]
    pub fn splat(x: f32) -> V {
        V([x; LANES])
    }

    #[inline(always)]
    pub fn load(values: &[f32], at: usize) -> V {
        let mut out = [0.0; LANES];
        out.copy_from_slice(&values[at..at + LANES]);
        V(out)
    }

    /// 0 and 1 as floats.
    #[inline(always)]
    pub fn load_u8(values: &[u8], at: usize) -> V {
        let mut out = [0.0; LANES];
        for (x, &v) in out.iter_mut().zip(&values[at..at + LANES]) {
            *x = f32::from(v);
        }
        V(out)
    }

    #[inline(always)]
    pub fn store(self, values: &mut [f32], at: usize) {
        values[at..at + LANES].copy_from_slice(&self.0);
    }

    #[inline(always)]
    pub fn sqrt(self) -> V {
        let mut out = self;
        for k in 0..LANES {
            out.0[k] = self.0[k].sqrt();
        }
        out
    }

    /// The other operand where this one is not a number.
    #[inline(always)]
    pub fn max(self, other: V) -> V {
        let mut out = other;
        for k in 0..LANES {
            out.0[k] = if self.0[k] > other.0[k] { self.0[k] } else { other.0[k] };
        }
        out
    }

    /// The other operand where this one is not a number.
    #[inline(always)]
    pub fn min(self, other: V) -> V {
        let mut out = other;
        for k in 0..LANES {
            out.0[k] = if self.0[k] < other.0[k] { self.0[k] } else { other.0[k] };
        }
        out
    }

    #[inline(always)]
    pub fn lt(self, other: V) -> Mask {
        let mut out = Mask([0; LANES]);
        for k in 0..LANES {
            out.0[k] = if self.0[k] < other.0[k] { u32::MAX } else { 0 };
        }
        out
    }

    /// The sum of the lanes, in a fixed order.
    #[inline(always)]
    pub fn sum(self) -> f32 {
        let v = self.0;
        ((v[0] + v[4]) + (v[2] + v[6])) + ((v[1] + v[5]) + (v[3] + v[7]))
    }
}

impl Mask {
    #[inline(always)]
    pub fn equal(a: &[u32], i: usize, b: &[u32; LANES]) -> Mask {
        let mut out = Mask([0; LANES]);
        for k in 0..LANES {
            out.0[k] = if a[i + k] == b[k] { u32::MAX } else { 0 };
        }
        out
    }

    /// `a` where true, `b` elsewhere.
    #[inline(always)]
    pub fn select(self, a: V, b: V) -> V {
        let mut out = V::ZERO;
        for k in 0..LANES {
            let bits = (a.0[k].to_bits() & self.0[k]) | (b.0[k].to_bits() & !self.0[k]);
            out.0[k] = f32::from_bits(bits);
        }
        out
    }
}
