//! The f64 side, which judges results: `exact`, `measure` and `reference` measure them and find the minimum with which
//! tests and benches compare them, and share no numerical code with the solver. `parity` compares the two backends.
//! `reference` and `parity` are not part of a library that is shipped: they come with the cargo feature `oracle`.

pub(crate) mod exact;
pub(crate) mod measure;
#[cfg(all(feature = "oracle", feature = "gpu"))]
#[allow(clippy::disallowed_macros, clippy::disallowed_methods, reason = "never in a library that is shipped")]
pub(crate) mod parity;
#[cfg(feature = "oracle")]
#[allow(clippy::disallowed_macros, clippy::disallowed_methods, reason = "never in a library that is shipped")]
pub(crate) mod reference;
