//! The laboratory of tests and benches (cargo feature `lab`), which no shipped library has: the f64 minimum that results are
//! compared with (`reference`, which shares no numerical code with the solver), and both backends side by side, stage by
//! stage (`compare`, `parity`).

pub(crate) mod asset;
#[cfg(feature = "gpu")]
mod compare;
#[cfg(feature = "gpu")]
pub(crate) mod parity;
pub(crate) mod reference;
