//! The desktop's dialogs for files. They run on a thread of their own, and the window goes on.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Mutex, PoisonError};

use eframe::egui;
use log::{LevelFilter, Log, Metadata, Record};
use rfd::{AsyncFileDialog, FileHandle};

/// Purpose of a dialog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    Rest,
    Poses,
    Rigidity,
    Texture,
    Normal,
    Asset,
    /// The folder to save to.
    Folder,
}

impl Ask {
    fn title(self) -> &'static str {
        match self {
            Ask::Rest => "Open a mesh at rest",
            Ask::Poses => "Open its poses, all at once",
            Ask::Rigidity => "Open a rigidity map",
            Ask::Texture => "Open a colour texture",
            Ask::Normal => "Open a normal map",
            Ask::Asset => "Open an asset folder",
            Ask::Folder => "Save to a folder",
        }
    }

    fn files(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Ask::Rest => ("meshes (OBJ, glTF)", &["obj", "gltf", "glb"]),
            Ask::Poses => ("poses (OBJ, f32)", &["obj", "f32"]),
            Ask::Rigidity | Ask::Texture | Ask::Normal => ("images (PNG)", &["png"]),
            Ask::Asset | Ask::Folder => ("folders", &["*"]),
        }
    }
}

/// Answer of a dialog: nothing if it was closed.
pub type Told = (Ask, Result<Vec<PathBuf>, String>);

/// The way back from dialogs.
pub struct Dialogs {
    sender: Sender<Told>,
    told: Receiver<Told>,
    /// True if one is on the screen.
    is_open: bool,
}

impl Dialogs {
    pub fn new() -> Dialogs {
        // Fails if there are other ears already, as in a test that opens several.
        let _ = log::set_logger(&EARS);
        log::set_max_level(LevelFilter::Error);
        let (sender, told) = channel();
        Dialogs { sender, told, is_open: false }
    }

    /// Shows a dialog, one at a time, which begins at a folder.
    pub fn open(&mut self, ask: Ask, folder: &Path, frame: &eframe::Frame, ctx: &egui::Context) {
        if std::mem::replace(&mut self.is_open, true) {
            return;
        }
        let (name, endings) = ask.files();
        let mut dialog = AsyncFileDialog::new().set_title(ask.title()).set_parent(frame);
        if !matches!(ask, Ask::Asset | Ask::Folder) {
            dialog = dialog.add_filter(name, endings);
        }
        if folder.is_dir() {
            dialog = dialog.set_directory(folder);
        }
        let (sender, ctx) = (self.sender.clone(), ctx.clone());
        let tell = move |paths: Option<Vec<PathBuf>>| {
            let failed = EARS.0.lock().unwrap_or_else(PoisonError::into_inner).take();
            let said = match (paths, failed) {
                (Some(paths), _) => Ok(paths),
                (None, None) => Ok(Vec::new()),
                (None, Some(reason)) => Err(format!(
                    "no file dialog here, neither the desktop's portal nor zenity: {reason}; type a path into the \
                     menu, or drop files on the window"
                )),
            };
            // Nobody listens once the window is closed.
            let _ = sender.send((ask, said));
            ctx.request_repaint();
        };
        let one = |file: Option<FileHandle>| file.map(|file| vec![PathBuf::from(file.path())]);
        let all = |files: Option<Vec<FileHandle>>| files.map(|f| f.iter().map(|f| f.path().into()).collect());
        // Some systems want dialogs made on the window's thread, but waiting there would stop the window.
        match ask {
            Ask::Poses => wait(dialog.pick_files(), move |files| tell(all(files))),
            Ask::Rest | Ask::Rigidity | Ask::Normal | Ask::Texture => {
                wait(dialog.pick_file(), move |file| tell(one(file)));
            }
            Ask::Asset | Ask::Folder => wait(dialog.pick_folder(), move |file| tell(one(file))),
        }
    }

    /// The dialog's answer, once it is closed.
    pub fn told(&mut self) -> Option<Told> {
        let told = self.told.try_recv().ok()?;
        self.is_open = false;
        Some(told)
    }
}

fn wait<T>(future: impl Future<Output = T> + Send + 'static, then: impl FnOnce(T) + Send + 'static) {
    std::thread::spawn(|| then(pollster::block_on(future)));
}

/// Hears why there is no dialog: that it failed is told to the log alone, and looks like a closed one.
struct Ears(Mutex<Option<String>>);

static EARS: Ears = Ears(Mutex::new(None));

impl Log for Ears {
    fn enabled(&self, metadata: &Metadata) -> bool {
        metadata.target().starts_with("rfd")
    }

    fn log(&self, record: &Record) {
        // Where there is no portal, zenity may well do.
        let text = record.args().to_string();
        if self.enabled(record.metadata()) && text.contains("zenity") {
            *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(text);
        }
    }

    fn flush(&self) {}
}
