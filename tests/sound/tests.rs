//! Programs for tools that find undefined behaviour: Miri and ThreadSanitizer (run.sh).

mod calls;
mod controls;
mod host;
mod storm;
