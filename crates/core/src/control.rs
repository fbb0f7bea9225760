//! Control over a running call: its progress, a callback that reports it, and cancellation.

use std::sync::atomic::{AtomicU8, AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};

use crate::clock::Instant;
use crate::error::Result;
use crate::local;
use crate::panics::lock;
use crate::unwind::{Stop, unwind};

/// A host's function that receives the progress of a call, 0..1, on the thread that does the call's work. Returning
/// true cancels the call. A call that succeeds reports 1 at its end; what is returned then has no effect.
pub type ProgressFn = Arc<dyn Fn(f32) -> bool + Send + Sync>;

/// Control over one call: its progress, and the means to cancel it from any thread. It can serve several calls in turn,
/// but once cancelled it cancels all later ones.
///
/// # Example
/// ```
/// # use std::sync::Arc;
/// # use vrtm::{Asset, Control, Device, DeviceSettings, ErrorKind, ImageView, SolveRequest, Strided};
/// # fn main() -> vrtm::Result<()> {
/// # let (rest, source) = vrtm_core::fixtures::square();
/// # let spot = |k: usize| [k % 32, k / 32].iter().all(|x| (12..20).contains(x));
/// # let painted: Vec<u8> = (0..32 * 32).map(|k| if spot(k) { 255 } else { 0 }).collect();
/// # let pose = rest.map(|[x, y, z]| [2.0 * x, y, z]);
/// # let mut asset = Asset::new(&Device::new(&DeviceSettings::default())?, &source)?;
/// # let tile = asset.find_tile(1001).expect("the UVs lie in the first tile");
/// # asset.tile_mut(tile).set_rigidity(Some(ImageView::from_texels("rigidity", &painted, [32, 32])?))?;
/// asset.run(&SolveRequest { positions: Strided::from_slice(&rest), ..SolveRequest::default() }, &mut [])?;
/// let energy = asset.tile(tile).report()?.energy;
///
/// let control = Arc::new(Control::new());
/// let request = SolveRequest {
///     positions: Strided::from_slice(&pose),
///     control: Some(control.clone()),
///     ..SolveRequest::default()
/// };
/// // From any thread, before the call or while it is going on:
/// control.cancel();
/// let error = asset.run(&request, &mut []).expect_err("it is cancelled");
/// assert_eq!(error.kind, ErrorKind::Cancelled);
/// assert_eq!(asset.tile(tile).report()?.energy, energy, "the last good result stays");
/// # Ok(())
/// # }
/// ```
#[derive(Default)]
pub struct Control {
    /// `GOING`, `CANCELLED` or `DONE`.
    state: AtomicU8,
    /// The fraction that is done: the bits of an f32.
    done: AtomicU32,
    /// Highest progress reported; it never decreases. Stored as the bits of an f32: those of positive numbers sort as
    /// the numbers do.
    told: AtomicU32,
    /// The stage in progress.
    stage: Mutex<Option<Stage>>,
    /// The thread that does the call's work and meanwhile calls the host's functions; 0 while no work is running.
    thread: AtomicUsize,
    watch: Option<Watch>,
    /// Number of items of work after which the call is cancelled; 0 = never.
    items_left: std::sync::atomic::AtomicU64,
}

/// A stage of the work. The largest stage of a solve takes half of its time.
struct Stage {
    start: Instant,
    /// Expected duration.
    seconds: f32,
    /// Fraction of the call's work.
    fraction: f32,
}

/// A host's progress function, and when it was called.
struct Watch {
    call: ProgressFn,
    start: Instant,
    /// Time of the last call, in microseconds from the start.
    last: AtomicU64,
}

const GOING: u8 = 0;
const CANCELLED: u8 = 1;
/// The call has its result and can no longer be cancelled.
const DONE: u8 = 2;

/// Microseconds between two calls of a host's function.
pub const PERIOD: u64 = 2000;

impl Control {
    /// A control whose progress the host polls.
    #[must_use]
    pub fn new() -> Control {
        Control::default()
    }

    /// A control that reports progress to a function, about 500 times per second.
    #[must_use]
    pub fn with_progress(call: ProgressFn) -> Control {
        let (start, last) = (Instant::now(), AtomicU64::new(0));
        Control { watch: Some(Watch { call, start, last }), ..Control::default() }
    }

    /// Cancels the call, which soon returns `Cancelled` and keeps the last good result. A call that already has its
    /// result is no longer cancelled.
    pub fn cancel(&self) {
        let _ = self.state.compare_exchange(GOING, CANCELLED, Ordering::Relaxed, Ordering::Relaxed);
    }

    /// For tests: cancels the call before the item of work with this number, counted from 1.
    #[doc(hidden)]
    pub fn cancel_at_item(&self, number: u64) {
        self.items_left.store(number, Ordering::Relaxed);
    }

    /// True if the call was cancelled.
    #[must_use]
    pub fn is_cancelled(&self) -> bool {
        self.state.load(Ordering::Relaxed) == CANCELLED
    }

    /// The predicted fraction of the call's work that is done, 0..1. It never decreases during a call.
    #[must_use]
    pub fn progress(&self) -> f32 {
        let mut progress = f32::from_bits(self.done.load(Ordering::Relaxed));
        if let Ok(stage) = self.stage.try_lock()
            && let Some(Stage { start, seconds, fraction }) = &*stage
        {
            progress += fraction * (start.elapsed().as_secs_f32() / seconds).min(1.0);
        }
        let bits = progress.min(1.0).to_bits();
        f32::from_bits(self.told.fetch_max(bits, Ordering::Relaxed).max(bits))
    }

    /// Begins a call's work: until the returned value is dropped, the calling thread is the one whose items of work
    /// call the host's function.
    #[must_use]
    pub fn begin(&self) -> Working<'_> {
        let _ = self.state.compare_exchange(DONE, GOING, Ordering::Relaxed, Ordering::Relaxed);
        self.done.store(0, Ordering::Relaxed);
        self.told.store(0, Ordering::Relaxed);
        *lock(&self.stage) = None;
        Working::on(self)
    }

    /// True if the calling thread does the call's work. It is then inside one of the host's functions and must not wait
    /// for the call. The work may run on a host's thread, so it need not be the thread that made the call.
    pub fn works_here(&self) -> bool {
        self.thread.load(Ordering::Relaxed) == this_thread()
    }

    /// Ends the part of a call that can be cancelled; unwinds if the call has already been cancelled.
    pub fn seal_or_unwind(&self) {
        let _ = self.state.compare_exchange(GOING, DONE, Ordering::Relaxed, Ordering::Relaxed);
        if self.is_cancelled() {
            unwind(Stop::Cancelled);
        }
        self.done.store(1.0f32.to_bits(), Ordering::Relaxed);
    }

    /// Tells the host's function that the call is done.
    pub fn tell_end(&self) {
        if let Some(watch) = &self.watch {
            let _working = Working::on(self);
            let _ = (watch.call)(1.0);
        }
    }

    /// Adds a fraction of the call's work to the completed part.
    pub fn advance(&self, fraction: f32) {
        let add = |bits| Some((f32::from_bits(bits) + fraction).min(1.0).to_bits());
        let _ = self.done.fetch_update(Ordering::Relaxed, Ordering::Relaxed, add);
    }

    /// Begins a stage with a fraction of the call's work and an expected duration. [`Control::end_stage`] adds the
    /// fraction when the stage is over.
    pub fn begin_stage(&self, fraction: f32, seconds: f32) {
        *lock(&self.stage) = Some(Stage { start: Instant::now(), seconds: seconds.max(1e-6), fraction });
    }

    /// Ends the stage and adds its fraction to the completed part.
    pub fn end_stage(&self, fraction: f32) {
        let mut stage = lock(&self.stage);
        *stage = None;
        self.advance(fraction);
    }

    /// True if the call should go on. Called before each item of work; it calls the host's function when due.
    #[inline]
    pub fn goes_on(&self) -> bool {
        if self.items_left.load(Ordering::Relaxed) > 0 && self.items_left.fetch_sub(1, Ordering::Relaxed) == 1
        {
            self.cancel();
        }
        // A host that has cancelled is not called again, however long the remaining work takes.
        if let Some(watch) = &self.watch
            && !self.is_cancelled()
            && self.works_here()
            && watch.is_due()
            && (watch.call)(self.progress())
        {
            self.cancel();
        }
        !self.is_cancelled()
    }

    /// `Cancelled` if the call was cancelled.
    pub fn check(&self) -> Result<()> {
        if self.goes_on() { Ok(()) } else { Err(Stop::Cancelled.error()) }
    }

    /// Unwinds if the call was cancelled.
    pub fn check_or_unwind(&self) {
        if !self.goes_on() {
            unwind(Stop::Cancelled);
        }
    }
}

impl std::fmt::Debug for Control {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Control")
            .field("cancelled", &self.is_cancelled())
            .field("progress", &self.progress())
            .finish_non_exhaustive()
    }
}

/// A call's work on one thread.
#[derive(Debug)]
pub struct Working<'a>(&'a Control);

impl<'a> Working<'a> {
    fn on(control: &'a Control) -> Working<'a> {
        control.thread.store(this_thread(), Ordering::Relaxed);
        Working(control)
    }
}

impl Drop for Working<'_> {
    fn drop(&mut self) {
        self.0.thread.store(0, Ordering::Relaxed);
    }
}

impl Watch {
    /// True if the host's function is due for a call.
    fn is_due(&self) -> bool {
        let now = self.start.elapsed().as_micros() as u64;
        let due = now >= self.last.load(Ordering::Relaxed) + PERIOD;
        if due {
            self.last.store(now, Ordering::Relaxed);
        }
        due
    }
}

/// Identifies a thread among those alive. Not std's thread id: that one creates a record that keeps the library from
/// being unloaded.
pub fn this_thread() -> usize {
    local::with(|local| &raw const *local as usize)
}

/// True if the calling thread is a host's thread that does a call's work, and so is inside one of the host's functions,
/// such as the progress function. A call into the library from there must not wait for the host's other threads, which
/// may all be waiting for this thread's work.
pub fn is_lent() -> bool {
    local::with(|local| local.lent.get())
}

/// Does a call's work on a host's thread.
pub fn lent<R>(work: impl FnOnce() -> R) -> R {
    struct Before(bool);
    impl Drop for Before {
        fn drop(&mut self) {
            local::with(|local| local.lent.set(self.0));
        }
    }
    let _before = Before(local::with(|local| local.lent.replace(true)));
    work()
}
