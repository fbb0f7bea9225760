//! An X server in memory, and what is on its screen.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Xvfb on a free display.
pub struct Server {
    child: Child,
    pub display: String,
    /// The screen as a file in the format of xwd.
    screen: PathBuf,
}

impl Server {
    pub fn start(folder: &Path, [width, height]: [u32; 2]) -> Server {
        let screen = format!("{width}x{height}x24");
        let mut child = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", &screen, "-nolisten", "tcp", "-fbdir"])
            .arg(folder)
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts");
        let mut number = String::new();
        let mut out = child.stdout.take().expect("piped");
        let mut byte = [0];
        // The number of the display, once the server is ready.
        while out.read(&mut byte).is_ok_and(|n| n == 1) && byte != [b'\n'] {
            number.push(char::from(byte[0]));
        }
        assert!(!number.is_empty(), "Xvfb ended");
        Server { child, display: format!(":{number}"), screen: folder.join("Xvfb_screen0") }
    }

    /// The screen, once it no longer changes.
    pub fn shot(&self) -> Shot {
        // The server answers after what the window has sent.
        let asked = Command::new("xdotool").arg("getmouselocation").env("DISPLAY", &self.display).output();
        assert!(asked.is_ok_and(|said| said.status.success()), "the X server does not answer");
        let start = Instant::now();
        let mut last = self.read();
        loop {
            std::thread::sleep(Duration::from_millis(250));
            let next = self.read();
            if next == last {
                return next;
            }
            assert!(start.elapsed() < Duration::from_secs(30), "the screen never comes to rest");
            last = next;
        }
    }

    fn read(&self) -> Shot {
        let bytes = std::fs::read(&self.screen).expect("the screen");
        let number = |k: usize| {
            let b = &bytes[4 * k..4 * k + 4];
            u32::from_be_bytes([b[0], b[1], b[2], b[3]])
        };
        let [header, width, height, colours] = [0, 4, 5, 19].map(number);
        let [little, bits, line] = [7, 11, 12].map(number);
        assert_eq!((little, bits), (0, 32), "pixels of 32 bits, the lowest byte first");
        let first = (header + 12 * colours) as usize;
        let rows = bytes[first..].chunks_exact(line as usize).take(height as usize);
        let pixels =
            rows.flat_map(|row| row[..4 * width as usize].chunks_exact(4)).map(|p| [p[2], p[1], p[0]]);
        Shot { size: [width, height], pixels: pixels.collect() }
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A picture.
#[derive(Clone, PartialEq)]
pub struct Shot {
    pub size: [u32; 2],
    pub pixels: Vec<[u8; 3]>,
}

/// The window's colours are dithered.
const NOISE: u8 = 3;

impl Shot {
    pub fn open(path: &Path) -> Shot {
        let image =
            image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).into_rgb8();
        Shot { size: image.dimensions().into(), pixels: image.pixels().map(|pixel| pixel.0).collect() }
    }

    /// A part: left, top, right, bottom.
    pub fn cut(&self, [left, top, right, bottom]: [u32; 4]) -> Shot {
        let row = |y: u32| {
            let start = y * self.size[0];
            &self.pixels[(start + left) as usize..(start + right) as usize]
        };
        Shot { size: [right - left, bottom - top], pixels: (top..bottom).flat_map(row).copied().collect() }
    }

    /// The same with a black upper left corner.
    pub fn without(&self, [width, height]: [u32; 2]) -> Shot {
        let mut shot = self.clone();
        for y in 0..height.min(self.size[1]) {
            let start = (y * self.size[0]) as usize;
            shot.pixels[start..start + width.min(self.size[0]) as usize].fill([0; 3]);
        }
        shot
    }

    /// The pixels that differ by more than noise.
    pub fn changes(&self, other: &Shot) -> Vec<[u32; 2]> {
        assert_eq!(self.size, other.size);
        let differs = |k: &usize| (0..3).any(|c| self.pixels[*k][c].abs_diff(other.pixels[*k][c]) > NOISE);
        let place = |k: usize| [k as u32 % self.size[0], k as u32 / self.size[0]];
        (0..self.pixels.len()).filter(differs).map(place).collect()
    }

    /// The share of pixels that differ.
    pub fn differing(&self, other: &Shot) -> f64 {
        self.changes(other).len() as f64 / self.pixels.len() as f64
    }
}
