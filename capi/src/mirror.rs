//! C structs and constants that mirror those of the Rust API. Each is a list of fields in the order of C, which grows
//! at its end only: the type, and where the value comes from if that is not the field of the same name. The fields'
//! comments in the header are those of the Rust API, so that a setting or a figure is described once
//! (`tests/c_api/header/mirrored.rs`).

use std::time::Duration;

use super::status::{Failure, Outcome};

/// A C struct, for the header.
pub struct Struct {
    /// Its name.
    pub name: &'static str,
    /// The Rust struct that it mirrors.
    pub of: &'static str,
    /// True for a plain value without a size, which never grows.
    pub is_plain: bool,
    /// Its fields, without the size.
    pub fields: &'static [Field],
}

/// A field of a C struct.
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its type, in Rust.
    pub kind: &'static str,
    /// An expression with the Rust value.
    pub from: &'static str,
    /// The comment of a field that Rust does not have, or not so.
    pub about: &'static str,
}

/// A type with constants.
pub struct Choice {
    /// Its name.
    pub name: &'static str,
    /// The Rust enum that it mirrors.
    pub of: &'static str,
    /// Constants, values and variants.
    pub values: &'static [(&'static str, i32, &'static str)],
}

/// A setting as a field of a C struct.
pub(super) trait Mirror<C>: Sized {
    fn to_c(&self) -> C;
    /// `name` is the field's, for messages.
    fn from_c(value: C, name: &str) -> Outcome<Self>;
}

macro_rules! same {
    ($($number:ty),+) => {
        $(impl Mirror<$number> for $number {
            fn to_c(&self) -> $number {
                *self
            }

            fn from_c(value: $number, _: &str) -> Outcome<$number> {
                Ok(value)
            }
        })+
    };
}
same!(f32, f64, u32, u64);

impl Mirror<u32> for bool {
    fn to_c(&self) -> u32 {
        u32::from(*self)
    }

    fn from_c(value: u32, name: &str) -> Outcome<bool> {
        match value {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(Failure::argument(format!("{name} is {value}, neither 0 nor 1"))),
        }
    }
}

/// 0 is `None`.
impl<T: Mirror<T> + Copy + Default + PartialEq> Mirror<T> for Option<T> {
    fn to_c(&self) -> T {
        self.unwrap_or_default()
    }

    fn from_c(value: T, _: &str) -> Outcome<Option<T>> {
        Ok((value != T::default()).then_some(value))
    }
}

/// Milliseconds, 0 for no limit. A limit too large for a `Duration` counts as no limit.
impl Mirror<f32> for Option<Duration> {
    fn to_c(&self) -> f32 {
        self.map_or(0.0, |limit| limit.as_secs_f32() * 1000.0)
    }

    fn from_c(ms: f32, name: &str) -> Outcome<Option<Duration>> {
        ensure!(ms >= 0.0 && ms.is_finite(), "{name}: {ms} is not a finite, non-negative number");
        Ok(Duration::try_from_secs_f32(ms / 1000.0).ok().filter(|_| ms > 0.0))
    }
}

/// The constants of a Rust enum.
macro_rules! choice {
    ($all:ident: $name:ident of $of:ident { $($constant:ident = $value:literal: $variant:ident),* $(,)? }) => {
        #[doc = concat!("[`", stringify!($of), "`] in C.")]
        pub type $name = i32;
        $(
            #[doc = concat!("[`", stringify!($of), "::", stringify!($variant), "`]")]
            pub const $constant: $name = $value;
        )*
        pub(super) const $all: $crate::mirror::Choice = $crate::mirror::Choice {
            name: stringify!($name),
            of: stringify!($of),
            values: &[$((stringify!($constant), $value, stringify!($variant))),*],
        };

        impl $crate::mirror::Mirror<$name> for $of {
            fn to_c(&self) -> $name {
                #[allow(unreachable_patterns)]
                match self {
                    $($of::$variant => $constant,)*
                    // A variant that C does not have yet.
                    _ => -1,
                }
            }

            fn from_c(value: $name, name: &str) -> $crate::status::Outcome<$of> {
                match value {
                    $($constant => Ok($of::$variant),)*
                    other => {
                        let kind = [$(stringify!($constant)),*][0].rsplit_once('_').map_or("", |(kind, _)| kind);
                        Err($crate::status::Failure::argument(format!("{name} is {other}, no {kind}_ value")))
                    }
                }
            }
        }
    };
}
pub(super) use choice;

/// A struct that the library fills, `report`, or that a host fills, `settings`; `plain` values have no size. One that
/// has grown tells the size that it had at `first`. Fields of settings with a comment are those of C alone.
macro_rules! mirror {
    (
        report $name:ident $(first $first:literal)? of $rust:ident: $of:ident {
            $($(#[doc = $doc:literal])* $field:ident: $type:ty $(= $from:expr)?,)*
        }
    ) => {
        mirror!(@sized $name $($first)? $rust $of
            [$([$($doc)*] $field: $type = [$($from)?],)*]);

        impl From<$of> for $name {
            fn from($rust: $of) -> $name {
                $name {
                    struct_size: 0,
                    $($field: <$type>::from(mirror!(@from $rust $field [$($from)?])),)*
                }
            }
        }
    };
    (
        plain report $name:ident of $rust:ident: $of:ident { $($field:ident: $type:ty $(= $from:expr)?,)* }
    ) => {
        mirror!(@struct $name [] $rust $of [$([] $field: $type = [$($from)?],)*]);

        impl From<$of> for $name {
            fn from($rust: $of) -> $name {
                $name { $($field: <$type>::from(mirror!(@from $rust $field [$($from)?])),)* }
            }
        }
    };
    (
        settings $name:ident $(first $first:literal)? of $rust:ident: $of:ident in $path:literal {
            $($(#[doc = $doc:literal])* $field:ident: $type:ty $(= $from:expr)?,)*
        }
    ) => {
        mirror!(@sized $name $($first)? $rust $of
            [$([$($doc)*] $field: $type = [$($from)?],)*]);

        impl From<&$of> for $name {
            fn from($rust: &$of) -> $name {
                let mut c: $name = $crate::desc::Sized32::zeroed();
                $(mirror!(@to_c c $rust $field [$($doc)*] [$($from)?]);)*
                c
            }
        }

        impl Default for $name {
            fn default() -> $name {
                $name::from(&$of::default())
            }
        }

        impl $name {
            /// The settings that a host asks for.
            pub(super) fn settings(&self) -> $crate::status::Outcome<$of> {
                let mut $rust = $of::default();
                $(mirror!(@from_c self $rust $path $field [$($doc)*] [$($from)?]);)*
                Ok($rust)
            }
        }
    };
    (plain settings $name:ident of $rust:ident: $of:ident { $($field:ident: $type:ty,)* }) => {
        mirror!(@struct $name [] $rust $of [$([] $field: $type = [],)*]);

        impl $crate::mirror::Mirror<$name> for $of {
            fn to_c(&self) -> $name {
                $name { $($field: self.$field,)* }
            }

            fn from_c(c: $name, _: &str) -> $crate::status::Outcome<$of> {
                Ok($of { $($field: c.$field,)* })
            }
        }
    };

    (
        @sized $name:ident $($first:literal)? $rust:ident $of:ident [$($fields:tt)*]
    ) => {
        mirror!(@struct $name [struct_size] $rust $of [$($fields)*]);

        // SAFETY: repr(C), struct_size first, plain numbers and pointers.
        $crate::desc::sized!($name $(= $first)?);
    };
    (
        @struct $name:ident [$($size:ident)?] $rust:ident $of:ident
        [$([$($doc:literal)*] $field:ident: $type:ty = [$($from:expr)?],)*]
    ) => {
        #[doc = concat!("[`", stringify!($of), "`] in C.")]
        #[allow(missing_docs)]
        #[repr(C)]
        #[derive(Clone, Copy)]
        pub struct $name {
            $(pub $size: u32,)?
            $(pub $field: $type,)*
        }

        impl $name {
            pub(super) const MIRROR: $crate::mirror::Struct = $crate::mirror::Struct {
                name: stringify!($name),
                of: stringify!($of),
                is_plain: <[&str]>::is_empty(&[$(stringify!($size),)?]),
                fields: &[$($crate::mirror::Field {
                    name: stringify!($field),
                    kind: stringify!($type),
                    from: [$(stringify!($from),)? concat!(stringify!($rust), ".", stringify!($field))][0],
                    about: concat!($($doc, "\n"),*),
                }),*],
            };
        }
    };

    (@from $rust:ident $field:ident []) => { $rust.$field };
    (@from $rust:ident $field:ident [$from:expr]) => { $from };
    // A field of C alone.
    (@to_c $c:ident $rust:ident $field:ident [$($doc:literal)+] []) => {};
    (@to_c $c:ident $rust:ident $field:ident [] $from:tt) => {
        $c.$field = $crate::mirror::Mirror::to_c(&mirror!(@from $rust $field $from));
    };
    (@from_c $c:tt $rust:ident $path:literal $field:ident [$($doc:literal)+] []) => {};
    (@from_c $c:tt $rust:ident $path:literal $field:ident [] $from:tt) => {
        mirror!(@from $rust $field $from) =
            $crate::mirror::Mirror::from_c($c.$field, concat!($path, ".", stringify!($field)))?;
    };
}
pub(super) use mirror;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_budget_of_zero_is_none_and_what_cannot_be_is_named() {
        let budget = |ms: f32| Option::<Duration>::from_c(ms, "options.time_budget_ms");
        assert_eq!(budget(0.0).unwrap(), None);
        assert_eq!(budget(2.0).unwrap(), Some(Duration::from_millis(2)));
        assert_eq!(budget(f32::MAX).unwrap(), None);
        for (ms, text) in [(-1.0, "-1"), (f32::NAN, "NaN"), (f32::INFINITY, "inf")] {
            let expected = format!("options.time_budget_ms: {text} is not a finite, non-negative number");
            assert_eq!(budget(ms).unwrap_err().message, expected);
        }
    }
}
