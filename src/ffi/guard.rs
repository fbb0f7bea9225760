//! The one panic boundary: whatever goes wrong inside leaves as a status and a message.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind, set_hook, take_hook};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Once, OnceLock};

use super::status::{
    Outcome, VRTM_ERROR_INTERNAL, VRTM_OK, set_last_error, set_panic_place, take_panic_place, vrtm_status,
};

thread_local! {
    /// How many guarded calls this thread is in: more than one if a host's callback calls back.
    static DEPTH: Cell<usize> = const { Cell::new(0) };
}

/// Guarded calls in flight on all threads.
static IN_FLIGHT: AtomicUsize = AtomicUsize::new(0);

/// Runs the body of the exported function `name`.
pub(super) fn guard(name: &str, body: impl FnOnce() -> Outcome<()>) -> vrtm_status {
    silence_panics();
    let outcome = {
        let _workers = InFlight::enter();
        let _inside = Inside::enter();
        // What a panic may leave half done is the asset behind its lock; a solve replaces its result at the end.
        catch_unwind(AssertUnwindSafe(body))
    };
    match outcome {
        Ok(Ok(())) => VRTM_OK,
        Ok(Err(failure)) => {
            set_last_error(name, &failure.message);
            failure.status
        }
        Err(panic) => {
            let place = take_panic_place();
            set_last_error(
                name,
                format_args!("internal error: {} ({})", panic_text(panic.as_ref()), place.as_str()),
            );
            VRTM_ERROR_INTERNAL
        }
    }
}

/// Runs what may panic though it should not: code of others that has no other way to say that a GPU is lost. `Err`
/// holds the panic's text and place; nothing is printed.
pub(crate) fn contain<R>(body: impl FnOnce() -> R) -> Result<R, String> {
    silence_panics();
    let _inside = Inside::enter();
    catch_unwind(AssertUnwindSafe(body))
        .map_err(|panic| format!("{} ({})", panic_text(panic.as_ref()), take_panic_place().as_str()))
}

fn panic_text(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&'static str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("a panic without a message")
}

/// This thread's panics are kept.
struct Inside;

impl Inside {
    fn enter() -> Inside {
        DEPTH.with(|depth| depth.set(depth.get() + 1));
        Inside
    }
}

impl Drop for Inside {
    fn drop(&mut self) {
        DEPTH.with(|depth| depth.set(depth.get() - 1));
    }
}

/// So are those of workers, while there may be any.
struct InFlight;

impl InFlight {
    fn enter() -> InFlight {
        IN_FLIGHT.fetch_add(1, Ordering::Relaxed);
        InFlight
    }
}

impl Drop for InFlight {
    fn drop(&mut self) {
        IN_FLIGHT.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Rust's standard hook writes panics to stderr, which belongs to the host: ours keeps the place of those that
/// happen inside a guarded call, on its thread or on a worker (workers are unnamed), and passes on all others (a
/// Rust program that links this crate has panics of its own).
fn silence_panics() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let _ = OTHERS.set(take_hook());
        // A function, not a closure that holds the other hook: that would need memory, which unloading leaves behind.
        set_hook(Box::new(keep_or_pass_on));
    });
}

/// The hook that was there before.
static OTHERS: OnceLock<Hook> = OnceLock::new();

type Hook = Box<dyn Fn(&PanicHookInfo<'_>) + Sync + Send>;

fn keep_or_pass_on(info: &PanicHookInfo<'_>) {
    let worker = || IN_FLIGHT.load(Ordering::Relaxed) > 0 && std::thread::current().name().is_none();
    if DEPTH.with(Cell::get) > 0 {
        if let Some(location) = info.location() {
            set_panic_place(location);
        }
    } else if let Some(others) = OTHERS.get().filter(|_| !worker()) {
        others(info);
    }
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;

    use super::super::status::{Failure, VRTM_ERROR_UNSUPPORTED, vrtm_last_error};
    use super::*;

    fn last_error() -> String {
        // SAFETY: the function returns this thread's zero-terminated line.
        unsafe { CStr::from_ptr(vrtm_last_error()) }.to_str().unwrap().to_owned()
    }

    #[test]
    fn a_panic_becomes_a_status_and_a_message_with_its_place() {
        let status = guard("vrtm_test", || panic!("index {} is bad", 7));
        assert_eq!(status, VRTM_ERROR_INTERNAL);
        let message = last_error();
        assert!(message.starts_with("vrtm_test: internal error: index 7 is bad ("), "{message}");
        assert!(message.contains("guard.rs:"), "{message}");
    }

    #[test]
    fn a_contained_panic_is_a_text_with_its_place() {
        assert_eq!(contain(|| 7), Ok(7));
        let text = contain(|| panic!("no {}", 8)).unwrap_err();
        assert!(text.starts_with("no 8 (") && text.contains("guard.rs:"), "{text}");
    }

    #[test]
    fn a_failure_becomes_its_status_and_a_success_leaves_the_message_alone() {
        let status = guard("vrtm_test", || Err(Failure::unsupported("format is 9")));
        assert_eq!(status, VRTM_ERROR_UNSUPPORTED);
        assert_eq!(guard("vrtm_other", || Ok(())), VRTM_OK);
        assert_eq!(last_error(), "vrtm_test: format is 9");
    }

    #[test]
    fn a_call_inside_a_callback_is_guarded_too() {
        let status = guard("vrtm_outer", || {
            assert_eq!(guard("vrtm_inner", || panic!("inner")), VRTM_ERROR_INTERNAL);
            Ok(())
        });
        assert_eq!(status, VRTM_OK);
        assert_eq!(DEPTH.with(Cell::get), 0);
    }
}
