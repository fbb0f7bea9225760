//! The panic boundary of the C functions: a panic inside never unwinds into the host, and writes nothing to its stderr.
//!
//! The standard hook prints panics. The hook installed here records the place of panics inside a boundary, on the
//! thread that entered it or on a worker thread (workers have no name), and passes all others to the previous hook. It
//! applies to the whole process.

use std::fmt::Write;
use std::panic::{PanicHookInfo, set_hook, take_hook};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Once, OnceLock};

use vrtm_core::line::Line;
use vrtm_core::local;
use vrtm_core::panics::{Panicked, catch_here};

/// Number of boundaries in use, over all threads, that also record the panics of worker threads.
static WITH_WORKERS: AtomicUsize = AtomicUsize::new(0);

/// Runs an entry point of the library. Panics of the worker threads that it starts are recorded, too.
#[allow(clippy::result_large_err, reason = "a box would need memory, which may be short")]
pub fn catch<R>(body: impl FnOnce() -> R) -> Result<R, Panicked> {
    struct WithWorkers;
    impl Drop for WithWorkers {
        fn drop(&mut self) {
            WITH_WORKERS.fetch_sub(1, Ordering::Relaxed);
        }
    }
    install();
    WITH_WORKERS.fetch_add(1, Ordering::Relaxed);
    let _leave = WithWorkers;
    catch_here(body)
}

type Hook = Box<dyn Fn(&PanicHookInfo<'_>) + Sync + Send>;

/// The hook that was installed before.
static PREVIOUS_HOOK: OnceLock<Hook> = OnceLock::new();

fn install() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let _ = PREVIOUS_HOOK.set(take_hook());
        // A function, not a closure over the previous hook: a closure would need memory, which unloading would leak.
        #[expect(clippy::disallowed_methods, reason = "zero-sized")]
        set_hook(Box::new(keep_or_pass_on));
    });
}

fn keep_or_pass_on(info: &PanicHookInfo<'_>) {
    let worker = || WITH_WORKERS.load(Ordering::Relaxed) > 0 && std::thread::current().name().is_none();
    if local::with(|local| local.depth.get()) > 0 {
        if let Some(location) = info.location() {
            let mut place = Line::new();
            // Cutting a place that is too long is no failure.
            let _ = write!(place, " ({location})");
            local::with(|local| local.place.set(place));
        }
    } else if let Some(previous) = PREVIOUS_HOOK.get().filter(|_| !worker()) {
        previous(info);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use vrtm_core::panics::contain;

    #[test]
    fn a_panic_inside_has_a_text_with_its_place() {
        let inner = catch(|| contain(|| panic!("no {}", 8)).unwrap_err()).ok().unwrap();
        assert!(inner.starts_with("no 8 (") && inner.contains("hook.rs:"), "{inner}");
        let outer = catch(|| panic!("no {}", 9)).err().unwrap().to_string();
        assert!(outer.starts_with("internal error: no 9 (") && outer.contains("hook.rs:"), "{outer}");
    }

    #[test]
    fn boundaries_nest() {
        let outer = catch(|| {
            let inner = catch(|| panic!("inner")).err().unwrap();
            assert_eq!(inner.text(), "inner");
            7
        });
        assert_eq!(outer.ok(), Some(7));
        assert_eq!(local::with(|local| local.depth.get()), 0);
    }
}
