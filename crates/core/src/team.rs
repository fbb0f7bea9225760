//! The threads of one call: scoped, so that none outlives it, and kept awake between the short jobs of a solve. They
//! are the library's own, or a host's (`executor`).

use std::cell::UnsafeCell;
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::ptr::without_provenance;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::allocation::{Current, Vec};
use crate::control::{Control, is_lent, lent};
pub use executor::{Executor, Task};
use protocol::Protocol;

pub mod executor;
pub mod protocol;
mod sync;
pub mod threads;

/// The threads that a call works on, their number, and the caller's control over the call.
#[derive(Clone, Default)]
pub struct Crew {
    /// Number of threads, including the calling one.
    pub threads: usize,
    /// The host's threads; `None` = the library's own.
    pub executor: Option<Arc<dyn Executor>>,
    pub control: Option<Arc<Control>>,
}

impl Crew {
    /// The same crew reduced to the present thread.
    pub fn alone(&self) -> Crew {
        Crew { threads: 1, executor: None, control: self.control.clone() }
    }
}

/// The threads of one call. It runs one job at a time.
pub struct Team {
    threads: usize,
    protocol: Protocol<JobFn>,
    /// True while a job is running.
    running: AtomicBool,
    start: Start,
    control: Option<Arc<Control>>,
}

/// One of a team's threads, passed to each item. Neither `Send` nor `Sync`: it stays on its thread.
pub struct Worker {
    number: usize,
    /// The team's address, which is only compared.
    team: *const (),
}

/// With at most this many items, waking helpers is not worth it.
const SMALL: usize = 2;

/// A team's turn at running a job, which ends when dropped.
struct Turn<'a>(&'a AtomicBool);

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.0.store(false, Ordering::Release);
    }
}

/// Starter of the helpers, until the first job that needs them; `None` where they are running or there are
/// none.
struct Start(UnsafeCell<Option<*const dyn Fn()>>);

// SAFETY: only the thread whose turn it is to run a job uses it, after it has been set; the function itself is called
// on the thread that called `Team::of`, as `run_dyn` says.
unsafe impl Sync for Start {}
// SAFETY: as above.
unsafe impl Send for Start {}

/// A job's function with its lifetime erased.
#[derive(Clone, Copy)]
struct JobFn(*const (dyn Fn(&Worker, usize) + Sync));
// SAFETY: the pointee is Sync.
unsafe impl Send for JobFn {}

impl Team {
    /// Calls `f` with a team of `threads` of the library's own threads, including the calling one.
    pub fn with<R: Send>(threads: usize, f: impl FnOnce(&Team) -> R + Send) -> R {
        Team::of(&Crew { threads, ..Crew::default() }, f)
    }

    /// Calls `f` with the team of a crew. With a host's threads, `f` may run on another thread than this one. If this
    /// is called from within a host's function, which one of these threads called in the middle of its work, `f` runs
    /// on that thread alone.
    pub fn of<R: Send>(crew: &Crew, f: impl FnOnce(&Team) -> R + Send) -> R {
        let most = if crew.executor.is_some() && is_lent() { 1 } else { Protocol::<JobFn>::MAX_THREADS };
        let threads = crew.threads.clamp(1, most);
        let (protocol, control) = (Protocol::new(threads), crew.control.clone());
        let start = Start(UnsafeCell::new(None));
        let team = Team { threads, protocol, running: AtomicBool::new(false), start, control };
        if team.threads == 1 {
            return if crew.executor.is_some() { lent(|| f(&team)) } else { f(&team) };
        }
        let (protocol, address) = (&team.protocol, team.address().addr());
        // Items allocate from the caller's allocator on every thread.
        let memory = Current::of_this_thread();
        let help = |number| {
            let _memory = memory.enter();
            let worker = Worker { number, team: without_provenance(address) };
            // SAFETY: called within a job that this helper has joined; `run_dyn` keeps its function alive.
            protocol.help(number, |job, k| unsafe { (*job.0)(&worker, k) });
        };
        let body = || {
            let _memory = memory.enter();
            let result = catch_unwind(AssertUnwindSafe(|| f(&team)));
            protocol.quit();
            result
        };
        let result = match &crew.executor {
            Some(executor) => executor::with(&**executor, threads, help, body),
            // A call that has little to do starts no thread.
            None => threads::with(1..threads, help, |start| {
                // SAFETY: only the lifetime changes. `body` runs all jobs of the team on this thread and has ended them
                // when it returns.
                let start = unsafe {
                    std::mem::transmute::<*const (dyn Fn() + '_), *const (dyn Fn() + 'static)>(start)
                };
                // SAFETY: no job is running yet.
                unsafe { *team.start.0.get() = Some(start) };
                body()
            }),
        };
        result.unwrap_or_else(|panic| resume_unwind(panic))
    }

    /// Number of threads.
    pub fn threads(&self) -> usize {
        self.threads
    }

    /// The caller's control over the call.
    pub fn control(&self) -> Option<&Arc<Control>> {
        self.control.as_ref()
    }

    /// Unwinds if the call was cancelled; see [`crate::unwind::caught`].
    pub fn check_or_unwind(&self) {
        if let Some(control) = &self.control {
            control.check_or_unwind();
        }
    }

    /// Calls `f(0)` to `f(count - 1)`, in any order and on any of the threads; returns when all are done.
    ///
    /// # Panics
    /// If an item panics, this panics with one of the payloads after all threads have left the job; other items may
    /// then not have run. Also if a job is already running: an item must not call this.
    ///
    /// If the call is cancelled, items that have not begun are skipped, and this unwinds.
    pub fn run(&self, count: usize, f: impl Fn(usize) + Sync) {
        self.run_on(count, |_, k| f(k));
    }

    /// Like `run`, with the thread as the first argument of `f`.
    pub fn run_on(&self, count: usize, f: impl Fn(&Worker, usize) + Sync) {
        self.run_few_on(SMALL, count, f);
    }

    /// Like `run_on`, but runs up to `few` items on the calling thread.
    fn run_few_on(&self, few: usize, count: usize, f: impl Fn(&Worker, usize) + Sync) {
        // Two jobs at once would share the items' counter and the caller's `Worker`.
        assert!(!self.running.swap(true, Ordering::Acquire), "a job of this team is running");
        let _turn = Turn(&self.running);
        let caller = Worker { number: 0, team: self.address() };
        let Some(control) = &self.control else {
            self.run_items(&caller, few, count, &f);
            return;
        };
        control.check_or_unwind();
        self.run_items(&caller, few, count, &|worker: &Worker, k| {
            if control.goes_on() {
                f(worker, k);
            }
        });
        // Unwinding is safe here: only this thread still uses the job.
        control.check_or_unwind();
    }

    fn run_items(&self, caller: &Worker, few: usize, count: usize, f: &(impl Fn(&Worker, usize) + Sync)) {
        if self.threads == 1 || count <= few {
            (0..count).for_each(|k| f(caller, k));
        } else {
            self.run_dyn(caller, count, f);
        }
    }

    /// Returns f(0) to f(count - 1), each computed on any of the threads.
    pub fn map<T: Send>(&self, count: usize, f: impl Fn(usize) -> T + Sync) -> Vec<T> {
        let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
        self.fill(&mut results, |k, result| *result = Some(f(k)));
        // Every element is initialised when `fill` returns.
        let mut all = Vec::with_capacity(count);
        all.extend(results.into_iter().flatten());
        all
    }

    /// Calls `f(k, element k)` for all elements, each on any of the threads.
    pub fn fill<T: Send>(&self, elements: &mut [T], f: impl Fn(usize, &mut T) + Sync) {
        self.fill_few_on(elements, SMALL, |_, k, element| f(k, element));
    }

    /// Like `fill`, for elements that are each worth a thread.
    pub fn fill_large<T: Send>(&self, elements: &mut [T], f: impl Fn(usize, &mut T) + Sync) {
        self.fill_few_on(elements, 1, |_, k, element| f(k, element));
    }

    /// Like `fill`, with the thread as the first argument of `f`.
    pub fn fill_on<T: Send>(&self, elements: &mut [T], f: impl Fn(&Worker, usize, &mut T) + Sync) {
        self.fill_few_on(elements, SMALL, f);
    }

    /// Like `fill_on`, but handles up to `few` elements on the calling thread.
    fn fill_few_on<T: Send>(
        &self,
        elements: &mut [T],
        few: usize,
        f: impl Fn(&Worker, usize, &mut T) + Sync,
    ) {
        let count = elements.len();
        let first = Elements(elements.as_mut_ptr());
        self.run_few_on(few, count, |worker, k| {
            let first = &first;
            // SAFETY: `run` calls each item once, so that references to an element never overlap, and returns before
            // the borrow of `elements` ends.
            f(worker, k, unsafe { &mut *first.0.add(k) });
        });
    }

    fn run_dyn<'a>(&self, caller: &Worker, count: usize, f: &'a (dyn Fn(&Worker, usize) + Sync + 'a)) {
        // SAFETY: only the lifetime changes. The protocol returns or unwinds only after all helpers that may call the
        // function have left the job, and gives it to no helper afterwards; `tests/loom` checks this.
        let job = JobFn(unsafe {
            std::mem::transmute::<
                *const (dyn Fn(&Worker, usize) + Sync + 'a),
                *const (dyn Fn(&Worker, usize) + Sync + 'static),
            >(f)
        });
        // SAFETY: it is this thread's turn, and the function is alive as long as jobs can be run. With threads of the
        // library, only the thread that called `Team::of` runs jobs, so the function is called where it was made.
        if let Some(start) = unsafe { (*self.start.0.get()).take() } {
            // SAFETY: as above.
            unsafe { (*start)() };
        }
        self.protocol.run(job, count, |k| f(caller, k));
    }

    /// Identifies a team among those alive.
    fn address(&self) -> *const () {
        (&raw const *self).cast()
    }
}

/// The first of the elements of `Team::fill`.
struct Elements<T>(*mut T);

// SAFETY: the threads get exclusive references to different elements.
unsafe impl<T: Send> Sync for Elements<T> {}

/// Memory that a job's items reuse: one piece per thread of a team, made on its first use. An item finds what the
/// previous item on its thread left, which depends on the timing: it must overwrite what it reads.
pub struct PerThread<'a, T> {
    pieces: Vec<Piece<T>>,
    new: fn() -> Box<T>,
    /// The team's address.
    team: *const (),
    /// The team outlives the pieces, so that no later team has its address.
    of_team: PhantomData<&'a ()>,
}

/// Aligned to cache lines of its own.
#[repr(align(128))]
struct Piece<T>(UnsafeCell<Option<Box<T>>>);

// SAFETY: only its own worker touches a piece, and a worker stays on its thread. Pieces are made, used and dropped on
// different threads, hence `Send`; never are two threads at one piece at the same time.
unsafe impl<T: Send> Sync for PerThread<'_, T> {}
// SAFETY: owns its pieces; the address is only compared.
unsafe impl<T: Send> Send for PerThread<'_, T> {}

impl<'a, T> PerThread<'a, T> {
    /// Memory for a team's threads, each of which makes its piece with `new`.
    pub fn new(team: &'a Team, new: fn() -> Box<T>) -> PerThread<'a, T> {
        let pieces = (0..team.threads).map(|_| Piece(UnsafeCell::new(None))).collect();
        PerThread { pieces, new, team: team.address(), of_team: PhantomData }
    }

    /// Calls `f` with the worker's piece. A call within `f` gets another piece.
    ///
    /// # Panics
    /// If the worker is of another team.
    pub fn with<R>(&self, worker: &Worker, f: impl FnOnce(&mut T) -> R) -> R {
        assert!(worker.team == self.team, "a worker of another team");
        let piece = self.pieces[worker.number].0.get();
        // SAFETY: a team has one worker of each number at a time, because it runs one job at a time, and a worker stays
        // on its thread, because it is not `Sync`. No reference into the cell outlives its statement, so `f` may call
        // this again.
        let mut own = unsafe { (*piece).take() }.unwrap_or_else(self.new);
        let result = f(&mut own);
        // SAFETY: as above.
        unsafe { *piece = Some(own) };
        result
    }
}

/// A slice whose elements the items of one job read and write concurrently. It holds no borrow: the compiler checks
/// neither that the slice is alive nor that references to one element exclude each other. Both are up to the caller.
///
/// From `new` to the last use of any copy, the slice must not move, and nothing else may access it.
#[derive(Debug)]
pub struct SharedSlice<T>(*mut T, usize);

impl<T> Clone for SharedSlice<T> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T> Copy for SharedSlice<T> {}
// SAFETY: any thread may get `&T` (`T: Sync`) and `&mut T` (`T: Send`), through the unsafe methods below alone.
unsafe impl<T: Send + Sync> Sync for SharedSlice<T> {}
// SAFETY: as above.
unsafe impl<T: Send + Sync> Send for SharedSlice<T> {}

impl<T> SharedSlice<T> {
    pub fn new(slice: &mut [T]) -> SharedSlice<T> {
        SharedSlice(slice.as_mut_ptr(), slice.len())
    }

    pub fn is_empty(self) -> bool {
        self.1 == 0
    }

    /// The address of element `i`, which may be in use.
    ///
    /// # Panics
    /// If `i` is out of range.
    #[inline(always)]
    pub fn address(self, i: usize) -> *const T {
        assert!(i < self.1);
        self.0.wrapping_add(i)
    }

    /// Element `i`. The caller vouches for the lifetime.
    ///
    /// # Panics
    /// If `i` is out of range.
    ///
    /// # Safety
    /// While the reference is in use, the slice is alive, and no item, including this one, uses a `get_mut` reference
    /// to this element.
    #[inline(always)]
    pub unsafe fn get<'a>(self, i: usize) -> &'a T {
        assert!(i < self.1);
        // SAFETY: in bounds; the rest is the caller's promise.
        unsafe { &*self.0.add(i) }
    }

    /// Element `i`. The caller vouches for the lifetime.
    ///
    /// # Panics
    /// If `i` is out of range.
    ///
    /// # Safety
    /// While the reference is in use, the slice is alive, and no item, including this one, uses another reference to
    /// this element.
    #[inline(always)]
    #[allow(clippy::mut_from_ref)]
    pub unsafe fn get_mut<'a>(self, i: usize) -> &'a mut T {
        assert!(i < self.1);
        // SAFETY: in bounds; the rest is the caller's promise.
        unsafe { &mut *self.0.add(i) }
    }
}
