//! Jobs: solves that run beside the host's own work.

use std::mem::replace;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use super::desc::sized;
use super::guard::{guard, guard_struct, guard_value};
use super::handle::{self, Kind, Table, vrtm_asset, vrtm_job};
use super::shared::{Claim, Solve};
use super::solve::{CheckedOptions, vrtm_solve_options};
use super::status::{
    Failure, Outcome, VRTM_ERROR_BUSY, VRTM_ERROR_CANCELLED, VRTM_ERROR_OUT_OF_MEMORY, VRTM_ERROR_TIMEOUT,
    VRTM_OK, status_of, vrtm_status,
};
use super::types::{strided, vrtm_array};
use crate::hook;
use vrtm::SolveRequest;
use vrtm_core::allocation::{Vec, boxed};
use vrtm_core::clock::Instant;
use vrtm_core::control::{Control, this_thread};
use vrtm_core::float_mode::FloatMode;
use vrtm_core::panics::lock;
use vrtm_core::team::threads;
use vrtm_core::view::Packed;

/// For vrtm_job_wait: wait as long as it takes.
pub const VRTM_FOREVER: u32 = u32::MAX;

/// State of a job.
pub type vrtm_job_state = i32;
/// It has not begun, or is under way.
pub const VRTM_JOB_RUNNING: vrtm_job_state = 0;
/// It has ended: vrtm_job_progress.status says how.
pub const VRTM_JOB_DONE: vrtm_job_state = 1;

/// The state and progress of a job. Start from vrtm_job_progress_init().
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_job_progress {
    /// sizeof(vrtm_job_progress); set by vrtm_job_progress_init().
    pub struct_size: u32,
    /// VRTM_JOB_RUNNING (0) or VRTM_JOB_DONE.
    pub state: vrtm_job_state,
    /// Its result: VRTM_OK or an error; VRTM_OK while it is running.
    pub status: vrtm_status,
    /// Predicted fraction (0..1) of the work that is done; it never decreases.
    pub progress: f32,
    /// Milliseconds from submission until now, or until the job ended.
    pub ms: f32,
}

// SAFETY: repr(C), struct_size first, plain numbers.
sized!(vrtm_job_progress);

/// One solve.
pub(super) struct Job {
    control: Arc<Control>,
    submitted: Instant,
    state: Mutex<State>,
    /// Notified when the job is done.
    done: Condvar,
    /// The thread that runs the job; 0 before it starts and after it ends.
    runs_on: AtomicUsize,
    /// The library's own thread, if it has one.
    thread: Mutex<Option<threads::Thread>>,
}

enum State {
    /// No thread has begun the job.
    Waiting(Box<Work>),
    Running,
    Done {
        outcome: Outcome<()>,
        ms: f32,
    },
}

/// Inputs of a job: the asset, which no other call may change meanwhile, and copies of the inputs.
struct Work {
    claim: Claim,
    positions: Packed,
    dirty_vertices: Option<Vec<u32>>,
    checked: CheckedOptions<'static>,
}

impl Work {
    fn run(mut self) -> Outcome<()> {
        let Work { claim, positions, dirty_vertices, checked } = &mut self;
        let request = checked.request(positions.view());
        let request = SolveRequest { dirty_vertices: dirty_vertices.as_deref(), ..request };
        Ok(claim.asset().run(&request, &mut [])?)
    }
}

impl Job {
    fn new(work: Work) -> Job {
        Job {
            control: work.checked.control.clone(),
            submitted: Instant::now(),
            state: Mutex::new(State::Waiting(boxed(work))),
            done: Condvar::new(),
            runs_on: AtomicUsize::new(0),
            thread: Mutex::new(None),
        }
    }

    /// Takes the work, unless another thread has begun it.
    fn begin(&self) -> Option<Box<Work>> {
        let mut state = lock(&self.state);
        match replace(&mut *state, State::Running) {
            State::Waiting(work) => Some(work),
            other => {
                *state = other;
                None
            }
        }
    }

    /// Does the work, unless another thread has begun it.
    fn run(&self) {
        let Some(work) = self.begin() else { return };
        self.runs_on.store(this_thread(), Ordering::Relaxed);
        let _mode = FloatMode::set_default();
        let outcome = hook::catch(|| work.run())
            .unwrap_or_else(|panic| Err(Failure { status: status_of(&panic), message: panic.to_string() }));
        self.runs_on.store(0, Ordering::Relaxed);
        self.end(outcome);
    }

    /// Records how the job ended. The work was dropped before, so the asset is free for other calls.
    fn end(&self, outcome: Outcome<()>) {
        let ms = self.submitted.elapsed().as_secs_f32() * 1000.0;
        *lock(&self.state) = State::Done { outcome, ms };
        self.done.notify_all();
    }

    /// An error on a thread that does the job's work, since it would wait for itself: the thread that runs the job, or
    /// the host's thread that runs the first task and calls the host's functions.
    fn check_thread(&self) -> Outcome<()> {
        if self.runs_on.load(Ordering::Relaxed) != this_thread() && !self.control.works_here() {
            return Ok(());
        }
        Err(Failure::new(VRTM_ERROR_BUSY, "job: a thread that does its work cannot wait for it"))
    }

    /// Waits for the job to end; `None` waits as long as it takes.
    fn wait(&self, time: Option<Duration>) -> Outcome<()> {
        self.check_thread()?;
        if time.is_none() {
            // If no thread has begun the job, this one does its work: it has nothing else to do.
            self.run();
        }
        let end = time.map(|time| Instant::now() + time);
        let mut state = lock(&self.state);
        loop {
            if let State::Done { outcome, .. } = &*state {
                return outcome.clone();
            }
            let Some(end) = end else {
                state = self.done.wait(state).unwrap_or_else(PoisonError::into_inner);
                continue;
            };
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Err(Failure::new(VRTM_ERROR_TIMEOUT, "job: it is not done yet"));
            }
            state = self.done.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}

impl Solve for Job {
    fn cancel(&self) {
        self.control.cancel();
        // A host's queue may take long to start a waiting job: end it here.
        if let Some(work) = self.begin() {
            drop(work);
            self.end(Err(Failure::new(VRTM_ERROR_CANCELLED, "the job was cancelled")));
        }
    }
}

static JOBS: Table<Job> = Table::new(Kind::Job, "job");

/// Begins to solve an asset for a pose, and returns at once, so that the host can keep drawing. Positions and options
/// are copied; everything else is as in vrtm_asset_solve. The caller destroys `*job`. A viewport that only wants its
/// newest pose sets options->replace.
///
/// Until the job is done, it has exclusive use of the asset: calls that solve or change the asset give VRTM_ERROR_BUSY,
/// and results and reports are those of the last solve. A job keeps what it needs alive: destroying the asset cancels
/// it, destroying the device does not affect it. It runs in the host's queue if the device has an executor with
/// `spawn`, and otherwise on a thread of its own, which ends with the job.
///
/// Errors: those of vrtm_asset_solve, except those that occur while solving, which vrtm_job_wait returns;
/// VRTM_ERROR_OUT_OF_MEMORY also if no thread can be started.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_asset_submit(
    asset: vrtm_asset,
    positions: *const vrtm_array,
    options: *const vrtm_solve_options,
    job: *mut vrtm_job,
) -> vrtm_status {
    guard_value("vrtm_asset_submit", job, "job", || {
        let shared = handle::asset(asset)?;
        // SAFETY: the host's pointers, valid during the call.
        let (positions, checked) =
            unsafe { (strided(positions, 3, "positions")?, CheckedOptions::read(asset, options)?) };
        let device = &shared.device;
        checked.request(positions).check(device, &shared.info)?;
        let copies = || Ok((Packed::copy(&positions), checked.dirty_vertices.map(Vec::from)));
        let (positions, dirty_vertices) = device.call(copies)?;
        let claim = if checked.replace { shared.claim_next() } else { shared.claim() }?;
        let work = Work { claim, positions, dirty_vertices, checked: checked.without_dirty_vertices() };
        let handle = vrtm_job { id: JOBS.add(Job::new(work))? };
        let job = JOBS.get("job", handle.id)?;
        shared.announce(job.clone());
        let own = job.clone();
        #[expect(
            clippy::disallowed_methods,
            reason = "of constant size: the job is there, and must not be lost"
        )]
        let task = Box::new(move || own.run());
        let left = match device.executor() {
            Some(executor) => executor.spawn(task).err(),
            None => Some(task as Box<dyn FnOnce() + Send>),
        };
        if let Some(task) = left {
            match threads::start(task) {
                Some(thread) => *lock(&job.thread) = Some(thread),
                None => {
                    job.cancel();
                    JOBS.remove(handle.id)?;
                    return Err(Failure::new(VRTM_ERROR_OUT_OF_MEMORY, "no thread could be started"));
                }
            }
        }
        Ok(handle)
    })
}

/// Waits until a job is done, for at most `timeout_ms` milliseconds; 0 returns at once, VRTM_FOREVER waits as long as
/// it takes. Any number of threads may wait, and each may wait again afterwards.
///
/// If no thread has begun the job yet, the first thread that waits with VRTM_FOREVER does its work.
///
/// Returns what vrtm_asset_solve would have returned, with its message: VRTM_OK once the result can be read;
/// VRTM_ERROR_CANCELLED after a cancel; VRTM_ERROR_TIMEOUT if the job is not done yet; VRTM_ERROR_BUSY on a thread that
/// does the job's work, as in its own progress function.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_job_wait(job: vrtm_job, timeout_ms: u32) -> vrtm_status {
    guard("vrtm_job_wait", || {
        let time = (timeout_ms != VRTM_FOREVER).then(|| Duration::from_millis(timeout_ms.into()));
        JOBS.get("job", job.id)?.wait(time)
    })
}

/// Gets the state and progress of a job. Never waits.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_job_get_progress(
    job: vrtm_job,
    progress: *mut vrtm_job_progress,
) -> vrtm_status {
    guard_struct("vrtm_job_get_progress", progress, "progress", || {
        let job = JOBS.get("job", job.id)?;
        let progress = job.control.progress();
        let now = job.submitted.elapsed().as_secs_f32() * 1000.0;
        let (state, status, ms) = match &*lock(&job.state) {
            State::Done { outcome, ms } => {
                let status = outcome.as_ref().err().map_or(VRTM_OK, |failure| failure.status);
                (VRTM_JOB_DONE, status, *ms)
            }
            _ => (VRTM_JOB_RUNNING, VRTM_OK, now),
        };
        Ok(vrtm_job_progress { struct_size: 0, state, status, progress, ms })
    })
}

/// Cancels a job: it ends soon after with VRTM_ERROR_CANCELLED, and the asset keeps its last good result. A job that
/// already has its result ends normally. Never waits.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_job_cancel(job: vrtm_job) -> vrtm_status {
    guard("vrtm_job_cancel", || {
        JOBS.get("job", job.id)?.cancel();
        Ok(())
    })
}

/// Destroys a job. A job that is not done is cancelled. The call waits until the job and its thread have ended. Destroy
/// all jobs before the library is unloaded.
///
/// Errors: VRTM_ERROR_BUSY on a thread that does the job's work, as in its own progress function.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn vrtm_job_destroy(job: vrtm_job) -> vrtm_status {
    guard("vrtm_job_destroy", || {
        let living = JOBS.get("job", job.id)?;
        living.check_thread()?;
        living.cancel();
        // The outcome no longer matters. The handle stays valid while waiting, so that other threads can ask for
        // progress.
        let _ = living.wait(None);
        let job = JOBS.remove(job.id)?;
        let thread = lock(&job.thread).take();
        if let Some(thread) = thread {
            thread.join();
        }
        Ok(())
    })
}
