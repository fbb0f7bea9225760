//! Programs for tools that find undefined behaviour: Miri (.ci/miri) and ThreadSanitizer (.ci/threads).

mod calls;
mod controls;
mod host;
mod storm;
