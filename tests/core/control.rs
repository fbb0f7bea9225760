use std::panic::{catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::Mutex;
use std::time::Duration;

use vrtm_core::clock::Instant;
use vrtm_core::control::*;
use vrtm_core::error::ErrorKind;
use vrtm_core::error::Result;
use vrtm_core::unwind::caught;

#[test]
fn a_cancelled_body_is_an_error_and_a_panic_is_none() {
    let control = Control::new();
    let body = || {
        control.check_or_unwind();
        Ok(7)
    };
    assert_eq!(caught(body).unwrap(), 7);
    control.cancel();
    assert_eq!(caught(body).unwrap_err().kind, ErrorKind::Cancelled);
    assert_eq!(control.check().unwrap_err().kind, ErrorKind::Cancelled);
    // A call with a result cannot be cancelled, but the next one can.
    let control = Control::new();
    control.seal_or_unwind();
    control.cancel();
    assert!(control.goes_on() && control.progress() == 1.0);
    let working = control.begin();
    control.cancel();
    assert!(!control.goes_on() && control.progress() == 0.0);
    let elsewhere = std::thread::scope(|scope| scope.spawn(|| control.works_here()).join().unwrap());
    assert!(control.works_here() && !elsewhere);
    drop(working);
    assert!(!control.works_here());
    let other = catch_unwind(|| caught(|| -> Result<()> { resume_unwind(Box::new(3)) }));
    assert_eq!(other.unwrap_err().downcast_ref(), Some(&3));
}

#[test]
fn the_host_s_function_is_called_on_one_thread_and_not_too_often() {
    let told = Arc::new(Mutex::new(Vec::new()));
    let control = {
        let told = told.clone();
        Control::with_progress(Arc::new(move |progress| {
            told.lock().unwrap().push((progress, this_thread()));
            progress >= 1.0
        }))
    };
    // The host's function is not called before the work begins, nor on other threads.
    assert!(control.goes_on());
    let _working = control.begin();
    std::thread::scope(|scope| scope.spawn(|| assert!(control.goes_on())).join().unwrap());
    assert!(told.lock().unwrap().is_empty());
    let start = Instant::now();
    while control.goes_on() {
        control.advance(1e-4);
        std::thread::yield_now();
    }
    // The host has cancelled: it is not called again by other work that takes long to end.
    let calls = told.lock().unwrap().len();
    let most = start.elapsed().as_micros() as u64 / PERIOD + 2;
    std::thread::sleep(Duration::from_micros(2 * PERIOD));
    assert!(!control.goes_on());
    let told = told.lock().unwrap();
    assert_eq!(told.len(), calls);
    assert!(told.iter().all(|(_, thread)| *thread == this_thread()));
    assert!(told.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    assert_eq!(told.last().unwrap().0, 1.0);
    assert!(told.len() as u64 <= most, "{} calls, at most {most}", told.len());
}
