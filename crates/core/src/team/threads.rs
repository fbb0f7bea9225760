//! Starts threads, and waits for their ends: a host may unload the library right after the call. If a team's helper
//! cannot be started, that is no error: the others do its work.

#[cfg(not(unix))]
use std::cell::RefCell;
use std::ops::Range;

#[cfg(not(unix))]
use crate::allocation::Vec;

/// Runs `body` on this thread. Once that calls the function that it is given, `help(number)` runs on a thread for each
/// of the numbers. `body` must make the helpers return; it does not unwind.
#[cfg(unix)]
pub fn with<R>(numbers: Range<usize>, help: impl Fn(usize) + Sync, body: impl FnOnce(&dyn Fn()) -> R) -> R {
    posix::with(numbers, help, body)
}

/// `with` through std, whose threads leave records on the thread that starts them. On these systems that does no harm.
#[cfg(not(unix))]
pub fn with<R>(numbers: Range<usize>, help: impl Fn(usize) + Sync, body: impl FnOnce(&dyn Fn()) -> R) -> R {
    std::thread::scope(|scope| {
        let help = &help;
        let start = |n| std::thread::Builder::new().spawn_scoped(scope, move || help(n)).ok();
        let helpers = RefCell::new(Vec::new());
        let result = body(&|| *helpers.borrow_mut() = numbers.clone().filter_map(start).collect());
        // A scope waits until its threads have run their closures, not until they end, and ending runs code of this
        // library, too.
        for helper in helpers.into_inner() {
            let _ = helper.join();
        }
        result
    })
}

/// Runs `work` on a thread of its own; `None` if the system cannot start another.
#[cfg(unix)]
pub use posix::{Thread, start};

/// `start` through std.
#[cfg(not(unix))]
pub struct Thread(std::thread::JoinHandle<()>);

#[cfg(not(unix))]
pub fn start(work: Box<dyn FnOnce() + Send>) -> Option<Thread> {
    std::thread::Builder::new().spawn(work).ok().map(Thread)
}

#[cfg(not(unix))]
impl Thread {
    /// Waits until the thread has ended.
    pub fn join(self) {
        let _ = self.0.join();
    }
}

/// POSIX threads without std: a thread that starts others through std gets a record that is freed by a destructor when
/// it ends, and until then the system keeps the library in memory, even after a host has closed it.
#[cfg(unix)]
mod posix {
    use std::cell::RefCell;
    use std::ffi::c_void;
    use std::mem::MaybeUninit;
    use std::ops::Range;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::ptr;

    use crate::allocation::Vec;

    /// The stack size of std's threads.
    const STACK: usize = 2 << 20;

    /// Work of a helper.
    struct Start<'a> {
        help: &'a (dyn Fn(usize) + Sync),
        number: usize,
    }

    extern "C" fn run(start: *mut c_void) -> *mut c_void {
        // SAFETY: `with` keeps `start` alive until this thread has ended.
        let start = unsafe { &*start.cast::<Start>() };
        // Panics of items are caught earlier, and handed to the caller.
        let _ = catch_unwind(AssertUnwindSafe(|| (start.help)(start.number)));
        ptr::null_mut()
    }

    /// Joins the threads, even if `with` unwinds.
    struct Helpers(Vec<libc::pthread_t>);

    impl Drop for Helpers {
        fn drop(&mut self) {
            for &thread in &self.0 {
                // SAFETY: the thread was started below and is joined once.
                unsafe { libc::pthread_join(thread, ptr::null_mut()) };
            }
        }
    }

    pub fn with<R>(
        numbers: Range<usize>,
        help: impl Fn(usize) + Sync,
        body: impl FnOnce(&dyn Fn()) -> R,
    ) -> R {
        let starts: Vec<Start> = numbers.map(|number| Start { help: &help, number }).collect();
        let helpers = RefCell::new(Helpers(Vec::with_capacity(starts.len())));
        let result = body(&|| {
            for start in &starts {
                // `start` lives until the thread is joined.
                let thread = spawn(run, ptr::from_ref(start).cast_mut().cast());
                helpers.borrow_mut().0.extend(thread);
            }
        });
        drop(helpers);
        result
    }

    /// A started thread, which must be joined.
    pub struct Thread(libc::pthread_t);

    impl Thread {
        /// Waits until the thread has ended.
        pub fn join(self) {
            // SAFETY: the thread was started below, and is joined once, as `self` is consumed.
            unsafe { libc::pthread_join(self.0, ptr::null_mut()) };
        }
    }

    type Body = Box<dyn FnOnce() + Send>;

    extern "C" fn work(body: *mut c_void) -> *mut c_void {
        // SAFETY: `start` made the body for this thread alone.
        let body = unsafe { Box::from_raw(body.cast::<Body>()) };
        let _ = catch_unwind(AssertUnwindSafe(body));
        ptr::null_mut()
    }

    pub fn start(body: Body) -> Option<Thread> {
        #[expect(clippy::disallowed_methods, reason = "of constant size")]
        let body = Box::into_raw(Box::new(body));
        let thread = spawn(work, body.cast());
        if thread.is_none() {
            // SAFETY: no thread received the body.
            drop(unsafe { Box::from_raw(body) });
        }
        thread.map(Thread)
    }

    /// Starts a thread; `None` if the system cannot start another. `argument` is passed to `function`.
    fn spawn(
        function: extern "C" fn(*mut c_void) -> *mut c_void,
        argument: *mut c_void,
    ) -> Option<libc::pthread_t> {
        let mut attributes = MaybeUninit::uninit();
        let mut thread = MaybeUninit::uninit();
        // SAFETY: the attributes are initialised before and destroyed after their use; the thread exists if the call
        // returns 0.
        unsafe {
            // Miri has neither attributes nor signals.
            if cfg!(miri) {
                let status = libc::pthread_create(thread.as_mut_ptr(), ptr::null(), function, argument);
                return (status == 0).then(|| thread.assume_init());
            }
            if libc::pthread_attr_init(attributes.as_mut_ptr()) != 0 {
                return None;
            }
            // If the system rejects this size, its default will do.
            let _ = libc::pthread_attr_setstacksize(attributes.as_mut_ptr(), STACK);
            let signals = Signals::hold_back();
            let status = libc::pthread_create(thread.as_mut_ptr(), attributes.as_ptr(), function, argument);
            drop(signals);
            libc::pthread_attr_destroy(attributes.as_mut_ptr());
            (status == 0).then(|| thread.assume_init())
        }
    }

    /// Blocks signals on this thread, and so on those that it starts, which inherit its mask: a host's timers and
    /// handlers are for the host's threads. Signals raised by a fault, and a profiler's, still come.
    struct Signals(libc::sigset_t);

    impl Signals {
        fn hold_back() -> Option<Signals> {
            const KEPT: [i32; 7] = [
                libc::SIGSEGV,
                libc::SIGBUS,
                libc::SIGFPE,
                libc::SIGILL,
                libc::SIGTRAP,
                libc::SIGABRT,
                libc::SIGPROF,
            ];
            let (mut all, mut before) = (MaybeUninit::uninit(), MaybeUninit::uninit());
            // SAFETY: the sets are filled before they are read.
            unsafe {
                libc::sigfillset(all.as_mut_ptr());
                KEPT.iter().for_each(|&signal| _ = libc::sigdelset(all.as_mut_ptr(), signal));
                let status = libc::pthread_sigmask(libc::SIG_BLOCK, all.as_ptr(), before.as_mut_ptr());
                (status == 0).then(|| Signals(before.assume_init()))
            }
        }
    }

    impl Drop for Signals {
        fn drop(&mut self) {
            // SAFETY: this restores the mask that this thread had.
            unsafe { libc::pthread_sigmask(libc::SIG_SETMASK, &self.0, ptr::null_mut()) };
        }
    }
}
