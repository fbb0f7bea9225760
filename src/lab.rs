//! Tools for tests and benches (cargo feature `lab`), absent from shipped libraries: the f64 minimum that results are
//! compared with (`reference`, which shares no numerical code with the solver), and a comparison of both backends, stage
//! by stage (`compare`, `parity`).

pub(crate) mod asset;
#[cfg(feature = "gpu")]
mod compare;
#[cfg(feature = "gpu")]
pub(crate) mod parity;
pub(crate) mod reference;
