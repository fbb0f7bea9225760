//! The f64 side, which judges results: `exact`, `measure` and `reference` measure them and find the minimum with which
//! tests and benches compare them, and share no numerical code with the solver. `parity` compares the two backends.

pub(crate) mod exact;
pub(crate) mod measure;
pub(crate) mod parity;
pub(crate) mod reference;
