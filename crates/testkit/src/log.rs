//! The log of a device, kept for tests.

use std::num::NonZeroU32;
use std::sync::{Arc, Mutex};

use vrtm::{Backend, Device, DeviceSettings, LogCode, LogEntry, LogFn, LogLevel};

/// A line without its words.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    pub level: LogLevel,
    pub code: LogCode,
    pub udim: Option<u32>,
    pub values: Vec<f64>,
}

/// The lines since they were last taken.
pub struct Lines(Arc<Mutex<Vec<Line>>>);

impl Lines {
    pub fn take(&self) -> Vec<Line> {
        std::mem::take(&mut self.0.lock().unwrap())
    }

    /// Takes all lines, and returns codes and values of the warnings.
    pub fn warnings(&self) -> Vec<(LogCode, Vec<f64>)> {
        let warnings = self.take().into_iter().filter(|line| line.level == LogLevel::Warning);
        warnings.map(|line| (line.code, line.values)).collect()
    }
}

/// A CPU device of one thread, and the lines of its log.
pub fn listened() -> (Device, Lines) {
    let lines = Arc::new(Mutex::new(Vec::new()));
    let book = lines.clone();
    let log: LogFn = Arc::new(move |&LogEntry { level, code, udim, values, message, .. }: &LogEntry| {
        assert!(!message.is_empty() && values.len() <= 6, "{code:?}: {message}, {values:?}");
        book.lock().unwrap().push(Line { level, code, udim, values: values.to_vec() });
    });
    let threads = NonZeroU32::new(1);
    let settings = DeviceSettings { backend: Backend::Cpu, threads, log: Some(log), ..Default::default() };
    (Device::new(&settings).unwrap(), Lines(lines))
}
