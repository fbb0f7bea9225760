//! Declares the constants shared by Rust and WGSL: once, in Rust.

/// A constant's type and value in WGSL.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constant {
    U32(u32),
    F32(f32),
    Vec2([f32; 2]),
}

/// A constant: its name, its value.
pub type Declaration = (&'static str, Constant);

/// Sizes and counts are u32 in WGSL; of a number that the CPU uses in f64, a GPU gets the nearest f32.
macro_rules! numbers {
    ($($number:ty: $kind:ident as $wgsl:ty),+) => {
        $(impl From<$number> for Constant {
            fn from(x: $number) -> Constant {
                Constant::$kind(x as $wgsl)
            }
        })+
    };
}
numbers!(u32: U32 as u32, usize: U32 as u32, f32: F32 as f32, f64: F32 as f32);

impl From<[f64; 2]> for Constant {
    fn from(ends: [f64; 2]) -> Constant {
        Constant::Vec2(ends.map(|x| x as f32))
    }
}

impl Constant {
    /// Its type and value in the notation of WGSL.
    pub fn wgsl(self) -> (&'static str, String) {
        match self {
            Constant::U32(x) if x > 1 << 16 => ("u32", format!("{x:#x}u")),
            Constant::U32(x) => ("u32", format!("{x}u")),
            Constant::F32(x) => ("f32", format!("{x:?}")),
            Constant::Vec2([x, y]) => ("vec2f", format!("vec2f({x:?}, {y:?})")),
        }
    }
}

/// Declares public constants, and a function `declarations` that lists them in the same order.
#[macro_export]
#[doc(hidden)]
macro_rules! constants {
    ($($(#[doc = $doc:literal])+ $name:ident: $ty:ty = $value:expr;)+) => {
        // Some are used by only one backend, or only by the shaders.
        $($(#[doc = $doc])+ #[allow(dead_code)] pub const $name: $ty = $value;)+

        /// All of these constants, in order.
        pub fn declarations() -> $crate::allocation::Vec<$crate::method::constants::Declaration> {
            $crate::allocation::vec![$((stringify!($name), $name.into())),+]
        }
    };
}
