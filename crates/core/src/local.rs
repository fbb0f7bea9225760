//! The library's data of each thread, in one record: plain values without a destructor, so that nothing is
//! registered with the thread, which would keep the library from being unloaded, or would run after it was unloaded.

mod record;

pub use record::{MESSAGE_BYTES, PLACE_BYTES};

#[cfg(not(all(windows, target_env = "gnu", not(target_abi = "llvm"))))]
mod native {
    use super::record::Local;

    // Initialised at compile time: reading it allocates nothing.
    thread_local! {
        static LOCAL: Local = const { Local::new() };
    }

    /// Calls `f` with this thread's record.
    #[inline]
    pub fn with<R>(f: impl FnOnce(&Local) -> R) -> R {
        LOCAL.with(f)
    }

    /// The same, or `None` if there is no memory for the record: never, as the thread was started with it.
    #[inline]
    pub fn try_with<R>(f: impl FnOnce(&Local) -> R) -> Option<R> {
        LOCAL.try_with(f).ok()
    }
}
#[cfg(not(all(windows, target_env = "gnu", not(target_abi = "llvm"))))]
pub use native::{try_with, with};

#[cfg(all(windows, target_env = "gnu", not(target_abi = "llvm")))]
mod windows_gnu;
#[cfg(all(windows, target_env = "gnu", not(target_abi = "llvm")))]
pub use windows_gnu::{try_with, with};
