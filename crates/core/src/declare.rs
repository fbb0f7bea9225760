//! Settings are declared once, by `settings!`: name, type, default, limits and words. The C struct, its comments and
//! initialiser, Python's options, those of `vrtm bake` and docs/settings.md follow from the declaration.

use std::fmt::{Display, LowerExp};
use std::ops::RangeInclusive;

use crate::error::{Error, Result};

/// One of a struct's settings, for programs that show settings or read them by their names.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Setting {
    /// Its name.
    pub name: &'static str,
    /// Its purpose, in the words of its documentation.
    pub about: &'static str,
    /// The default, as an expression of Rust.
    pub default: &'static str,
    /// A number's least and largest value; `None` for what is no number, and for other limits, which `about` tells.
    pub limits: Option<[f32; 2]>,
}

pub fn check<T: PartialOrd + Display + LowerExp>(
    name: &str,
    value: &T,
    range: &RangeInclusive<T>,
) -> Result<()> {
    if range.contains(value) {
        return Ok(());
    }
    // 1e6 rather than 1000000.
    let [least, most] = [range.start(), range.end()].map(|end| {
        let (plain, short) = (format!("{end}"), format!("{end:e}"));
        if short.len() < plain.len() { short } else { plain }
    });
    Err(Error::argument(format!("{name}: {value} is not between {least} and {most}")))
}

/// Declares a struct of settings: `pub NAME: TYPE = DEFAULT, LEAST to MOST;`, the limits for numbers.
macro_rules! settings {
    (
        $(#[$meta:meta])*
        pub struct $name:ident in $path:literal {
            $($(#[doc = $doc:literal])* pub $field:ident: $type:ty = $default:expr $(, $least:literal to $most:literal)?;)*
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq)]
        pub struct $name {
            $(
                $(#[doc = $doc])*
                #[doc = concat!("\n\n", $("From ", $least, " to ", $most, "; ",)? "default `", stringify!($default), "`.")]
                pub $field: $type,
            )*
        }

        impl Default for $name {
            fn default() -> Self {
                $name { $($field: $default),* }
            }
        }

        impl $name {
            /// All of its settings.
            pub const SETTINGS: &'static [$crate::declare::Setting] = &[$($crate::declare::Setting {
                name: stringify!($field),
                about: concat!($($doc),*),
                default: stringify!($default),
                limits: $crate::declare::limits!($($least, $most)?),
            }),*];

            /// Access to a number by its name.
            pub fn number(&mut self, name: &str) -> Option<&mut f32> {
                $(if name == stringify!($field) {
                    return (&mut self.$field as &mut dyn std::any::Any).downcast_mut();
                })*
                None
            }

            fn check_limits(&self) -> Result<()> {
                $($($crate::declare::check(
                    concat!($path, ".", stringify!($field)), &self.$field, &($least..=$most),
                )?;)?)*
                Ok(())
            }
        }
    };
}
pub(crate) use settings;

macro_rules! limits {
    () => {
        None
    };
    ($least:literal, $most:literal) => {
        Some([$least as f32, $most as f32])
    };
}
pub(crate) use limits;
