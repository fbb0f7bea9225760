//! The method, independent of any backend: the schedule of a solve, and the rules and constants that both backends
//! follow. `docs/method.md` derives all of it; comments cite it as "method §n".

#[macro_use]
pub mod constants;
pub mod law;
pub mod acceptance;
pub mod pbd;
pub mod stage;
pub mod plan;
pub mod cost;
pub mod deadline;
pub mod progress;
pub mod schedule;
