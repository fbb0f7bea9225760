//! The method, independent of any backend: the schedule of a solve, and the rules and constants that both backends
//! follow. `docs/method.md` derives all of it; comments cite it as "method §n".

pub(crate) mod constants;
pub(crate) mod law;
pub(crate) mod acceptance;
pub(crate) mod pbd;
pub(crate) mod stage;
pub(crate) mod plan;
pub(crate) mod cost;
pub(crate) mod deadline;
pub(crate) mod progress;
pub(crate) mod schedule;
