//! Solves on a thread of its own: what is asked for (`inbox`), when to ask (`flow`), the thread (`worker`), and what
//! comes back (`answer`).

pub mod answer;
pub mod flow;
pub mod inbox;
pub mod worker;
