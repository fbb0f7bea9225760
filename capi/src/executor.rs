//! Lets a host run the library's work on its own threads.

use std::ffi::c_void;

use super::desc::{self, User, sized};
use super::status::{Failure, Outcome};
use crate::hook;
use vrtm_core::team::{Executor, Task};

/// One of the library's tasks: the host runs it by calling it with the `data` that came with it.
pub type vrtm_task_fn = Option<unsafe extern "C" fn(data: *mut c_void, index: usize)>;

/// A host's parallel loop, such as TBB's parallel_for: it calls `task(data, index)` for each index from 0 to `count` -
/// 1, exactly once, on any threads and in any order, and returns when all of these calls have returned. Several threads
/// may call it at once. The first task to begin does the work of the call, and the others help it, so the calling
/// thread should run tasks too.
pub type vrtm_parallel_for_fn =
    Option<unsafe extern "C" fn(user: *mut c_void, count: usize, task: vrtm_task_fn, data: *mut c_void)>;

/// A host's task queue: it calls `task(data, 0)` once, on any thread, immediately or later. It must return normally.
pub type vrtm_spawn_fn =
    Option<unsafe extern "C" fn(user: *mut c_void, task: vrtm_task_fn, data: *mut c_void)>;

/// A host's threads, which do all work instead of the library's own threads, with the same results bit for bit. Start
/// from vrtm_executor_init(). The functions and `user` must stay valid until the device, all of its assets and all of
/// their jobs are destroyed.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct vrtm_executor {
    /// sizeof(vrtm_executor); set by vrtm_executor_init().
    pub struct_size: u32,
    /// Runs the parallel loops of solves and fetches; `count` is the number of threads that the device or the solve
    /// asks for. Required.
    pub parallel_for: vrtm_parallel_for_fn,
    /// Runs jobs; null = the library starts a thread for each job.
    pub spawn: vrtm_spawn_fn,
    /// Passed unchanged to both functions.
    pub user: *mut c_void,
}

// SAFETY: repr(C), struct_size first, plain numbers and pointers.
sized!(vrtm_executor);

/// A host's functions.
pub(super) struct HostExecutor {
    parallel_for: unsafe extern "C" fn(*mut c_void, usize, vrtm_task_fn, *mut c_void),
    spawn: vrtm_spawn_fn,
    user: User,
}

impl HostExecutor {
    /// Reads a host's executor; null gives `None`.
    pub unsafe fn read(executor: *const vrtm_executor, name: &str) -> Outcome<Option<HostExecutor>> {
        if executor.is_null() {
            return Ok(None);
        }
        // SAFETY: the host's pointer.
        let from = unsafe { desc::read(executor, name) }?;
        let parallel_for =
            from.parallel_for.ok_or_else(|| Failure::argument(format!("{name}.parallel_for is null")))?;
        Ok(Some(HostExecutor { parallel_for, spawn: from.spawn, user: User(from.user) }))
    }
}

/// Runs one index of a parallel loop.
unsafe extern "C" fn run_index(data: *mut c_void, index: usize) {
    // SAFETY: the pointer that `parallel_for` passed; its call has not returned yet.
    let task = unsafe { *data.cast::<&(dyn Fn(usize) + Sync)>() };
    // The task itself does not unwind: it stores a panic for the thread that waits for it.
    let _ = hook::catch(|| task(index));
}

/// Runs a job.
unsafe extern "C" fn run_task(data: *mut c_void, _: usize) {
    // SAFETY: the pointer that `spawn` passed, and the host calls this once.
    let task = unsafe { Box::from_raw(data.cast::<Task>()) };
    let _ = hook::catch(task);
}

impl Executor for HostExecutor {
    fn parallel_for(&self, count: usize, task: &(dyn Fn(usize) + Sync)) {
        let data = (&raw const task).cast_mut().cast();
        // SAFETY: the host vouches for its function, which returns after all calls of the task.
        unsafe { (self.parallel_for)(self.user.pointer(), count, Some(run_index), data) }
    }

    fn spawn(&self, task: Task) -> Result<(), Task> {
        let Some(spawn) = self.spawn else { return Err(task) };
        #[expect(clippy::disallowed_methods, reason = "of constant size")]
        let data = Box::into_raw(Box::new(task)).cast();
        // SAFETY: the host vouches for its function; it calls the task once, which frees it.
        unsafe { spawn(self.user.pointer(), Some(run_task), data) };
        Ok(())
    }
}
