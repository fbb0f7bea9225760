//! The guard that every exported function runs in: it turns errors and panics into a status and a message, and sets the
//! processor's default floating-point mode.

use super::desc::{self, Sized32};
use super::status::{Outcome, VRTM_ERROR_OUT_OF_MEMORY, VRTM_OK, set_last_error, status_of, vrtm_status};
use crate::hook;
use vrtm_core::float_mode::FloatMode;
use vrtm_core::local;

/// Runs the body of the exported function `name`. A solve that panics leaves its asset's last result in place.
pub(super) fn guard(name: &str, body: impl FnOnce() -> Outcome<()>) -> vrtm_status {
    // The first call of a thread may find no memory for what all else relies on.
    if local::try_with(|_| ()).is_none() {
        return VRTM_ERROR_OUT_OF_MEMORY;
    }
    let _mode = FloatMode::set_default();
    match hook::catch(body) {
        Ok(Ok(())) => VRTM_OK,
        Ok(Err(failure)) => {
            set_last_error(name, &failure.message);
            failure.status
        }
        Err(panic) => {
            set_last_error(name, &panic);
            status_of(&panic)
        }
    }
}

/// Runs the body of an exported function that fills the host's struct `argument`.
pub(super) fn guard_struct<T: Sized32>(
    name: &str,
    pointer: *mut T,
    argument: &str,
    body: impl FnOnce() -> Outcome<T>,
) -> vrtm_status {
    guard(name, || desc::fill(pointer, argument, body))
}

/// Runs the body of an exported function whose value goes to the host's `argument`.
pub(super) fn guard_value<T: Copy>(
    name: &str,
    pointer: *mut T,
    argument: &str,
    body: impl FnOnce() -> Outcome<T>,
) -> vrtm_status {
    guard(name, || desc::put(pointer, argument, body))
}

#[cfg(test)]
mod tests {
    use super::super::status::tests::last_error;
    use super::super::status::{Failure, VRTM_ERROR_INTERNAL, VRTM_ERROR_UNSUPPORTED};
    use super::*;

    #[test]
    fn a_panic_becomes_a_status_and_a_message_with_its_place() {
        let status = guard("vrtm_test", || panic!("index {} is bad", 7));
        assert_eq!(status, VRTM_ERROR_INTERNAL);
        let message = last_error();
        assert!(message.starts_with("vrtm_test: internal error: index 7 is bad ("), "{message}");
        assert!(message.contains("guard.rs:"), "{message}");
    }

    #[test]
    fn a_failure_becomes_its_status_and_a_success_leaves_the_message_alone() {
        let status = guard("vrtm_test", || Err(Failure::unsupported("format is 9")));
        assert_eq!(status, VRTM_ERROR_UNSUPPORTED);
        assert_eq!(guard("vrtm_other", || Ok(())), VRTM_OK);
        assert_eq!(last_error(), "vrtm_test: format is 9");
    }
}
