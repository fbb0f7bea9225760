//! Starts threads, and waits for their ends: a host may unload the library right after the call. If a team's helper
//! cannot be started, that is no error: the others do its work.

use std::cell::RefCell;
use std::ops::Range;

use crate::allocation::Vec;

/// Runs `body` on this thread. Once that calls the function that it is given, `help(number)` runs on a thread for each
/// of the numbers. `body` must make the helpers return; it does not unwind.
pub fn with<R>(numbers: Range<usize>, help: impl Fn(usize) + Sync, body: impl FnOnce(&dyn Fn()) -> R) -> R {
    /// Joins the threads, even if `with` unwinds.
    struct Helpers(Vec<Thread>);
    impl Drop for Helpers {
        fn drop(&mut self) {
            self.0.drain(..).for_each(Thread::join);
        }
    }
    let (help, helpers) = (&help, RefCell::new(Helpers(Vec::with_capacity(numbers.len()))));
    body(&|| {
        for number in numbers.clone() {
            #[expect(clippy::disallowed_methods, reason = "of constant size")]
            let work: Box<dyn FnOnce() + Send + '_> = Box::new(move || help(number));
            // SAFETY: only the lifetime changes: the thread is joined before `help` is dropped.
            let work = unsafe {
                std::mem::transmute::<Box<dyn FnOnce() + Send + '_>, Box<dyn FnOnce() + Send + 'static>>(work)
            };
            helpers.borrow_mut().0.extend(start(work));
        }
    })
}

/// Runs `work` on a thread of its own; `None` if the system cannot start another.
#[cfg(unix)]
pub use posix::{Thread, start};
#[cfg(all(target_family = "wasm", target_feature = "atomics"))]
pub use workers::{Thread, serve, start};

/// `start` through std, whose threads leave records on the thread that starts them. On these systems that does no harm.
#[cfg(not(any(unix, target_feature = "atomics")))]
pub struct Thread(std::thread::JoinHandle<()>);

#[cfg(not(any(unix, target_feature = "atomics")))]
pub fn start(work: Box<dyn FnOnce() + Send>) -> Option<Thread> {
    std::thread::Builder::new().spawn(work).ok().map(Thread)
}

#[cfg(not(any(unix, target_feature = "atomics")))]
impl Thread {
    /// Waits until the thread has ended.
    pub fn join(self) {
        let _ = self.0.join();
    }
}

/// WebAssembly with shared memory starts no threads: a page does, and its workers wait here for work.
#[cfg(all(target_family = "wasm", target_feature = "atomics"))]
mod workers {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};

    use crate::panics::lock;

    /// Workers that wait, and what they are to do.
    type State = (usize, Vec<(Box<dyn FnOnce() + Send>, Arc<AtomicBool>)>);
    static STATE: Mutex<State> = Mutex::new((0, Vec::new()));
    static NEWS: Condvar = Condvar::new();

    fn next(state: MutexGuard<'static, State>) -> MutexGuard<'static, State> {
        NEWS.wait(state).unwrap_or_else(PoisonError::into_inner)
    }

    /// Work of a worker: true when it is done.
    pub struct Thread(Arc<AtomicBool>);

    pub fn start(work: Box<dyn FnOnce() + Send>) -> Option<Thread> {
        let mut state = lock(&STATE);
        let is_free = state.0 > state.1.len();
        is_free.then(|| {
            let is_done = Arc::new(AtomicBool::new(false));
            state.1.push((work, is_done.clone()));
            NEWS.notify_all();
            Thread(is_done)
        })
    }

    impl Thread {
        /// Waits until the work is done.
        pub fn join(self) {
            let mut state = lock(&STATE);
            while !self.0.load(Ordering::Acquire) {
                state = next(state);
            }
        }
    }

    /// Gives the calling worker to the library, for ever.
    pub fn serve() -> ! {
        let mut state = lock(&STATE);
        loop {
            state.0 += 1;
            while state.1.is_empty() {
                state = next(state);
            }
            state.0 -= 1;
            if let Some((work, is_done)) = state.1.pop() {
                drop(state);
                work();
                state = lock(&STATE);
                is_done.store(true, Ordering::Release);
                NEWS.notify_all();
            }
        }
    }
}

/// POSIX threads without std: a thread that starts others through std gets a record that is freed by a destructor when
/// it ends, and until then the system keeps the library in memory, even after a host has closed it.
#[cfg(unix)]
mod posix {
    use std::ffi::c_void;
    use std::mem::MaybeUninit;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::ptr;

    /// The stack size of std's threads.
    const STACK: usize = 2 << 20;

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
