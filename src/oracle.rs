//! The f64 side: what results are measured with, and what tests and benches compare them with. It shares no code with the
//! solver that it judges.

pub(crate) mod exact;
pub(crate) mod measure;
pub(crate) mod parity;
pub(crate) mod reference;
