//! Solves on a thread of its own: what is asked for (`inbox`), when to ask (`flow`), the thread (`worker`), what
//! comes back (`answer`), and where it is at its worst (`worst`).

pub mod answer;
pub mod flow;
pub mod inbox;
pub mod worker;
pub mod worst;
