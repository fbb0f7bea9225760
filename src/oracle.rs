//! The f64 side: what results are measured with, and what tests and benches compare them with. It shares no code with the
//! solver that it judges. The reference solver and the comparison of both backends are not part of a library that is
//! shipped: they come with the cargo feature `oracle`.

pub(crate) mod exact;
pub(crate) mod measure;
#[cfg(all(feature = "oracle", feature = "gpu"))]
pub(crate) mod parity;
#[cfg(feature = "oracle")]
pub(crate) mod reference;
