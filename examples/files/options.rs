//! Values of options.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use vrtm::Backend;

/// The backends of `--device`.
pub const DEVICES: [(&str, Backend); 3] =
    [("auto", Backend::Auto), ("cpu", Backend::Cpu), ("gpu", Backend::Gpu)];

/// Parses a name into the value that it denotes.
pub fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [(&'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(|(name, _)| name))
        .map(move |text| all.iter().find(|(name, _)| *name == text).expect("one of the names").1)
}
