//! Generates `shaders/generated.wgsl`: the constants and structs that Rust and WGSL share, from their declarations in
//! Rust. The file is committed, so that the shaders can be read and checked on their own; a test compares it with the
//! declarations.

/// Declares structs with public fields that also exist in WGSL and, for tests, a function `struct_declarations` that
/// lists them. `as` precedes the name of a field's type in WGSL if it differs.
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
        #[cfg(test)]
        pub fn struct_declarations() -> std::vec::Vec<$crate::generated::Struct> {
            std::vec![$((
                stringify!($struct),
                std::vec![$((
                    stringify!($field),
                    // The name after `as`, if present, comes first and takes precedence.
                    [$($wgsl.to_owned(),)? <$ty as WgslType>::name()].into_iter().next().unwrap_or_default(),
                )),+],
            )),+]
        }
    };
}
pub(crate) use structs;

#[cfg(test)]
pub use text::{Struct, WgslType};

#[cfg(test)]
mod text {
    use std::fmt::Write;

    use super::super::{layout, redirect};
    use vrtm_core::method::constants::Declaration;
    use vrtm_core::method::law;

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

    /// The text of `shaders/generated.wgsl`.
    pub fn text() -> String {
        let mut text = String::from(
            "// Written from law.rs of core, layout.rs and redirect.rs of gpu, which tell what all is.\n",
        );
        text += "// Change those, then VRTM_UPDATE_SHADERS=1 cargo test -p vrtm-gpu --lib generated\n";
        // Writing to a string cannot fail.
        let _ = constants(&mut text, &law::declarations());
        let _ = constants(&mut text, &layout::shared::declarations());
        let _ = structs(&mut text, &layout::struct_declarations());
        let _ = structs(&mut text, &redirect::struct_declarations());
        text
    }

    fn constants(text: &mut String, all: &[Declaration]) -> std::fmt::Result {
        writeln!(text)?;
        for (name, value) in all {
            let (ty, value) = value.wgsl();
            writeln!(text, "const {name}: {ty} = {value};")?;
        }
        Ok(())
    }

    fn structs(text: &mut String, all: &[Struct]) -> std::fmt::Result {
        for (name, fields) in all {
            writeln!(text)?;
            writeln!(text, "struct {name} {{")?;
            for (name, ty) in fields {
                writeln!(text, "    {name}: {ty},")?;
            }
            writeln!(text, "}}")?;
        }
        Ok(())
    }

    #[test]
    fn the_committed_file_is_the_generated_one() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shaders/generated.wgsl");
        if std::env::var_os("VRTM_UPDATE_SHADERS").is_some_and(|value| value == "1") {
            std::fs::write(file, text()).unwrap();
        }
        let differs =
            "shaders/generated.wgsl differs: VRTM_UPDATE_SHADERS=1 cargo test -p vrtm-gpu --lib generated";
        assert!(std::fs::read_to_string(file).unwrap() == text(), "{differs}");
    }
}
