//! Writes files so that each appears completely or not at all, even on a full disk or when a signal arrives.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::{flag, low_level};

use crate::failure::{Failure, Result};
use crate::overwrite;

/// Held while a file is written; a signal does not end the program meanwhile.
static WRITING: Mutex<()> = Mutex::new(());

fn writing() -> MutexGuard<'static, ()> {
    WRITING.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From here on a signal ends the program as a shell expects, with the status 128 + its number, but only after the file
/// being written has its final name. A separate thread does this: a signal's handler may not take locks, and the main
/// thread may be busy for a while.
pub fn watch_signals() -> Result<()> {
    let failure = |e: io::Error| Failure::named("signals", e);
    let code = Arc::new(AtomicUsize::new(0));
    for signal in [SIGTERM, SIGINT] {
        flag::register_usize(signal, code.clone(), 128 + signal as usize).map_err(failure)?;
    }
    // A file longer than the system allows is then reported like a full disk, instead of ending the program.
    #[cfg(unix)]
    flag::register(signal_hook::consts::SIGXFSZ, Arc::default()).map_err(failure)?;
    let watcher = move || {
        loop {
            let code = code.load(Ordering::SeqCst);
            if code != 0 {
                // This lock is never released, so that no further file is started.
                let _whole = writing();
                // Skips the libraries' exit handlers, because threads of the solve are still running.
                low_level::exit(code as i32);
            }
            thread::sleep(Duration::from_millis(10));
        }
    };
    thread::Builder::new().name("signals".into()).spawn(watcher).map_err(failure)?;
    Ok(())
}

/// A folder that files are written to.
#[derive(Debug)]
pub struct Output {
    folder: PathBuf,
    /// Planned files that have not been written yet.
    planned: BTreeSet<String>,
}

impl Output {
    /// Creates the folder if it does not exist. `planned` lists the files that [`overwrite::check`] has passed.
    pub fn new(folder: &Path, planned: Vec<String>) -> Result<Output> {
        fs::create_dir_all(folder).map_err(|e| Failure::file(folder, e))?;
        Ok(Output { folder: folder.into(), planned: planned.into_iter().collect() })
    }

    /// Writes a file.
    pub fn write(&mut self, name: &str, bytes: &[u8]) -> Result<()> {
        assert!(self.planned.contains(name), "{name} may be somebody's file");
        let path = self.folder.join(name);
        let _whole = writing();
        self.replace(&path, name, bytes).map_err(|e| Failure::file(&path, e))?;
        self.planned.remove(name);
        Ok(())
    }

    fn replace(&self, path: &Path, name: &str, bytes: &[u8]) -> io::Result<()> {
        let mut number = std::process::id();
        // The temporary file is in the same folder, so that it can be renamed.
        let (temporary, mut file) = loop {
            let temporary = self.folder.join(format!(".{name}.{number}.part"));
            match File::create_new(&temporary) {
                Ok(file) => break (temporary, file),
                // Left by a program that was killed, or in use by one with the same process number on another machine.
                Err(e) if e.kind() == ErrorKind::AlreadyExists => number = number.wrapping_add(1),
                Err(e) => return Err(e),
            }
        };
        // Some systems report a full disk only once the file is synchronised.
        let written = file.write_all(bytes).and_then(|()| file.sync_all());
        drop(file);
        let renamed = written.and_then(|()| match fs::read(&temporary)? == bytes {
            true => fs::rename(&temporary, path),
            false => Err(io::Error::other("holds something else than was written to it")),
        });
        if renamed.is_err() {
            let _ = fs::remove_file(&temporary);
        }
        // The name should survive a crash, too. Windows ensures this itself, and some file systems cannot.
        #[cfg(unix)]
        let _ = File::open(&self.folder).and_then(|folder| folder.sync_all());
        renamed
    }
}

impl Drop for Output {
    fn drop(&mut self) {
        // Planned files that were not written after a failure may exist from before in a damaged state; they must not
        // be taken for results.
        self.planned.iter().for_each(|name| overwrite::remove_if_damaged(&self.folder.join(name)));
    }
}
