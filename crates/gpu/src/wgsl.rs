//! Constants and structs that Rust and WGSL share, in WGSL, from their declarations in Rust.

use std::fmt::{Result, Write};

use vrtm_core::allocation::Vec;
use vrtm_core::method::constants::Declaration;

/// Declares structs with public fields that also exist in WGSL, and a function `struct_declarations` that lists them.
/// `as` precedes the name of a field's type in WGSL if it differs.
macro_rules! structs {
    ($($(#[doc = $doc:literal])+ $(#[derive($derive:ident)])? pub struct $struct:ident {
        $($(#[doc = $field_doc:literal])* $field:ident: $ty:ty $(as $wgsl:literal)?,)+
    })+) => {
        $(
            $(#[doc = $doc])+
            #[repr(C)]
            #[derive(Clone, Copy, Debug, Pod, Zeroable $(, $derive)?)]
            pub struct $struct {
                $($(#[doc = $field_doc])* pub $field: $ty,)+
            }
        )+

        /// All structs declared here.
        fn struct_declarations() -> vrtm_core::allocation::Vec<$crate::wgsl::Struct> {
            use vrtm_core::allocation::vec;
            vec![$((
                stringify!($struct),
                vec![$((
                    stringify!($field),
                    // The name after `as`, if present, comes first and takes precedence.
                    [$($wgsl.to_owned(),)? <$ty as WgslType>::name()].into_iter().next().unwrap_or_default(),
                )),+],
            )),+]
        }
    };
}
pub(crate) use structs;

/// The WGSL name of a field's type.
pub trait WgslType {
    fn name() -> String;
}

impl WgslType for u32 {
    fn name() -> String {
        "u32".to_owned()
    }
}

impl WgslType for f32 {
    fn name() -> String {
        "f32".to_owned()
    }
}

impl<T: WgslType, const N: usize> WgslType for [T; N] {
    fn name() -> String {
        format!("array<{}, {N}>", T::name())
    }
}

/// A struct: its name, and the names and WGSL types of its fields.
pub type Struct = (&'static str, Vec<(&'static str, String)>);

/// Writes declarations in WGSL.
pub fn write(text: &mut String, constants: &[Declaration], structs: &[Struct]) -> Result {
    for (name, value) in constants {
        let (ty, value) = value.wgsl();
        writeln!(text, "const {name}: {ty} = {value};")?;
    }
    for (name, fields) in structs {
        writeln!(text, "struct {name} {{")?;
        for (name, ty) in fields {
            writeln!(text, "    {name}: {ty},")?;
        }
        writeln!(text, "}}")?;
    }
    Ok(())
}
