//! Time that other programs and tests do not lengthen.

/// The result of a function, and the seconds that the calling thread's processor took for it; where systems do not
/// tell, those of a clock. Devices of one thread solve and prepare on the calling thread.
pub fn seconds<R>(f: impl FnOnce() -> R) -> (f64, R) {
    let start = now();
    let result = f();
    (now() - start, result)
}

#[cfg(unix)]
fn now() -> f64 {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the function writes the struct alone.
    let error = unsafe { libc::clock_gettime(libc::CLOCK_THREAD_CPUTIME_ID, &mut time) };
    assert_eq!(error, 0, "no clock of the thread");
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

#[cfg(not(unix))]
fn now() -> f64 {
    static START: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    START.elapsed().as_secs_f64()
}
