//! SIGTERM and Ctrl-C: the program ends at once, and takes the files with it that have not got their names yet.

use std::fs;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{flag, low_level};

use crate::failure::{Failure, Result};

/// Files that are being written: the temporary name and the final one of each. Who holds the lock is not interrupted.
#[derive(Clone, Debug, Default)]
pub struct Unfinished(Arc<Mutex<Vec<(PathBuf, PathBuf)>>>);

impl Unfinished {
    pub fn lock(&self) -> MutexGuard<'_, Vec<(PathBuf, PathBuf)>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes the temporary files.
    pub fn remove(files: &mut Vec<(PathBuf, PathBuf)>) {
        for (temporary, _) in files.drain(..) {
            // Errors are ignored: the program already ends for another reason.
            let _ = fs::remove_file(temporary);
        }
    }
}

/// From here on a signal ends the program as a shell expects it, with 128 + its number, and leaves no temporary file.
/// A thread of its own does so: a signal's handler may not touch files, and the main thread may be busy for a while.
pub fn watch() -> Result<Unfinished> {
    let failure = |e: io::Error| Failure::named("signals", e);
    let code = Arc::new(AtomicUsize::new(0));
    for signal in [SIGTERM, SIGINT] {
        flag::register_usize(signal, code.clone(), 128 + signal as usize).map_err(failure)?;
    }
    // A file that is longer than the system allows is then told like a full disk, and does not end the program.
    #[cfg(unix)]
    flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).map_err(failure)?;
    let unfinished = Unfinished::default();
    let files = unfinished.clone();
    let watcher = move || {
        loop {
            let code = code.load(Ordering::SeqCst);
            if code != 0 {
                let mut files = files.lock();
                Unfinished::remove(&mut files);
                // Without what the libraries do at an exit: threads of the solve are still running. The lock is never
                // released, so that no further file is begun.
                low_level::exit(code as i32);
            }
            thread::sleep(Duration::from_millis(10));
        }
    };
    thread::Builder::new().name("signals".into()).spawn(watcher).map_err(failure)?;
    Ok(unfinished)
}
