//! The panic boundary. A panic of this library, or of a library that it calls, never unwinds into the host and never
//! writes to the host's stderr: it becomes an `Err` with the panic's text and place.
//!
//! The standard hook prints panics. The hook installed here keeps the place of those that happen inside a boundary, on
//! the thread that entered it or on a worker thread (workers have no name), and passes all others on to the hook that
//! was there before, since a Rust program that links this crate has panics of its own.

use std::any::Any;
use std::cell::Cell;
use std::fmt::{self, Write};
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, resume_unwind, set_hook, take_hook};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, Once, OnceLock, PoisonError};

use crate::allocation::OutOfMemory;
use crate::line::Line;

/// Bytes of a panic's place; a longer one is cut.
const PLACE_BYTES: usize = 128;

// Plain values, initialised at compile time: no destructor is registered with the thread, which would keep the library
// from being unloaded or would run after it was.
thread_local! {
    /// How many boundaries this thread is in: more than one if a host's callback calls back.
    static DEPTH: Cell<usize> = const { Cell::new(0) };
    /// Where this thread's last panic inside a boundary came from.
    static PLACE: Cell<Line<PLACE_BYTES>> = const { Cell::new(Line::new()) };
}

/// Boundaries in use on all threads whose worker threads' panics are kept, too.
static WITH_WORKERS: AtomicUsize = AtomicUsize::new(0);

/// Why a body did not return.
pub(crate) struct Panicked {
    payload: Box<dyn Any + Send>,
    place: Line<PLACE_BYTES>,
}

impl Panicked {
    /// The panic's message.
    pub fn text(&self) -> &str {
        let literal = self.payload.downcast_ref::<&'static str>().copied();
        let formatted = || self.payload.downcast_ref::<String>().map(String::as_str);
        literal.or_else(formatted).unwrap_or("a panic without a message")
    }

    /// If it is no panic, but memory that is missing.
    pub fn out_of_memory(&self) -> Option<&OutOfMemory> {
        self.payload.downcast_ref()
    }

    /// File, line and column.
    pub fn place(&self) -> &str {
        self.place.as_str()
    }
}

impl fmt::Display for Panicked {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.out_of_memory() {
            Some(short) => short.fmt(f),
            None => write!(f, "internal error: {} ({})", self.text(), self.place()),
        }
    }
}

/// Runs an entry point of the library. Panics of the worker threads that it starts are kept, too.
#[allow(clippy::result_large_err, reason = "a box would need memory, which may be short")]
pub(crate) fn catch<R>(body: impl FnOnce() -> R) -> Result<R, Panicked> {
    struct WithWorkers;
    impl Drop for WithWorkers {
        fn drop(&mut self) {
            WITH_WORKERS.fetch_sub(1, Ordering::Relaxed);
        }
    }
    install_hook();
    WITH_WORKERS.fetch_add(1, Ordering::Relaxed);
    let _leave = WithWorkers;
    catch_here(body)
}

/// Runs code of others that panics where it should fail (wgpu on a lost device). `Err` holds the panic's text and
/// place. Memory that is missing goes on to the caller.
#[cfg(any(test, feature = "gpu"))]
pub(crate) fn contain<R>(body: impl FnOnce() -> R) -> Result<R, String> {
    install_hook();
    catch_here(body).map_err(|panic| {
        if panic.out_of_memory().is_some() {
            resume_unwind(panic.payload);
        }
        format!("{} ({})", panic.text(), panic.place())
    })
}

/// Holds back a panic of `body`, so that what it was lent can be put back first; [`go_on`] lets it go on. For calls that
/// are cancelled, which end by unwinding: memory that solves keep has to be whole then.
pub(crate) fn hold_back<R>(body: impl FnOnce() -> R) -> std::thread::Result<R> {
    catch_unwind(AssertUnwindSafe(body))
}

/// See [`hold_back`].
pub(crate) fn go_on<R>(held_back: std::thread::Result<R>) -> R {
    held_back.unwrap_or_else(|panic| resume_unwind(panic))
}

/// Catches this thread's panics.
#[allow(clippy::result_large_err, reason = "a box would need memory, which may be short")]
fn catch_here<R>(body: impl FnOnce() -> R) -> Result<R, Panicked> {
    struct Inside;
    impl Drop for Inside {
        fn drop(&mut self) {
            DEPTH.with(|depth| depth.set(depth.get() - 1));
        }
    }
    DEPTH.with(|depth| depth.set(depth.get() + 1));
    let _leave = Inside;
    // State that a panic leaves half done is dropped with its owner, or stands behind a lock that discards it.
    catch_unwind(AssertUnwindSafe(body)).map_err(|payload| Panicked { payload, place: take_place() })
}

fn take_place() -> Line<PLACE_BYTES> {
    PLACE.try_with(|kept| kept.replace(Line::new())).unwrap_or(Line::new())
}

type Hook = Box<dyn Fn(&PanicHookInfo<'_>) + Sync + Send>;

/// The hook that was there before.
static PREVIOUS_HOOK: OnceLock<Hook> = OnceLock::new();

fn install_hook() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let _ = PREVIOUS_HOOK.set(take_hook());
        // A function, not a closure that holds the other hook: that would need memory, which unloading leaves behind.
        #[expect(clippy::disallowed_methods, reason = "of no size")]
        set_hook(Box::new(keep_or_pass_on));
    });
}

fn keep_or_pass_on(info: &PanicHookInfo<'_>) {
    let worker = || WITH_WORKERS.load(Ordering::Relaxed) > 0 && std::thread::current().name().is_none();
    if DEPTH.with(Cell::get) > 0 {
        if let Some(location) = info.location() {
            let mut place = Line::new();
            // A place that is too long is cut: that is no failure.
            let _ = write!(place, "{location}");
            let _ = PLACE.try_with(|kept| kept.set(place));
        }
    } else if let Some(previous) = PREVIOUS_HOOK.get().filter(|_| !worker()) {
        previous(info);
    }
}

/// Locks, whatever became of those that had the lock before: what all locks of the library guard is written in one step, so
/// that it is whole even where a thread panicked with the lock.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_contained_panic_is_a_text_with_its_place() {
        assert_eq!(contain(|| 7), Ok(7));
        let text = contain(|| panic!("no {}", 8)).unwrap_err();
        assert!(text.starts_with("no 8 (") && text.contains("panics.rs:"), "{text}");
    }

    #[test]
    fn boundaries_nest() {
        let outer = catch(|| {
            let inner = catch(|| panic!("inner")).err().unwrap();
            assert_eq!(inner.text(), "inner");
            7
        });
        assert_eq!(outer.ok(), Some(7));
        assert_eq!(DEPTH.with(Cell::get), 0);
    }
}
