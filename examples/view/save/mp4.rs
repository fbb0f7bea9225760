//! A moving picture as an MP4: frames go to the program ffmpeg.

use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use vrtm_examples::whole::Whole;

use super::clip::{Film, Result};

pub struct Mp4 {
    child: Running,
    whole: Whole,
}

/// The program, which ends with the clip that is given up.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Path of ffmpeg, if it is in the PATH.
pub fn program() -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let name = format!("ffmpeg{}", std::env::consts::EXE_SUFFIX);
    std::env::split_paths(&path).map(|folder| folder.join(&name)).find(|file| file.is_file())
}

impl Mp4 {
    pub fn new(program: &Path, path: &Path, [width, height]: [u32; 2], rate: u16) -> Result<Mp4> {
        let (whole, file) = Whole::create(path)?;
        drop(file);
        let child = Command::new(program)
            .args(["-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgba"])
            .args(["-s", &format!("{width}x{height}"), "-r", &rate.to_string(), "-i", "-"])
            // Players want colours for every two by two pixels.
            .args(["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p", "-b:v", "12M"])
            .args(["-movflags", "+faststart", "-f", "mp4"])
            .arg(whole.part())
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|error| format!("{}: {error}", program.display()))?;
        Ok(Mp4 { child: Running(child), whole })
    }

    /// Message of ffmpeg, or else the error.
    fn said(&mut self, error: &dyn std::fmt::Display) -> String {
        drop(self.child.0.stdin.take());
        let mut text = String::new();
        if let Some(mut out) = self.child.0.stderr.take() {
            let _ = out.read_to_string(&mut text);
        }
        let reason = text.lines().last().map_or_else(|| error.to_string(), str::to_string);
        format!("ffmpeg: {reason}")
    }
}

impl Film for Mp4 {
    fn add(&mut self, pixels: &[u8]) -> Result<()> {
        let written = self.child.0.stdin.as_mut().map_or(Ok(()), |to| to.write_all(pixels));
        Ok(written.map_err(|error| self.said(&error))?)
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        drop(self.child.0.stdin.take());
        match self.child.0.wait() {
            Ok(status) if status.success() => {}
            Ok(status) => return Err(self.said(&status).into()),
            Err(error) => return Err(self.said(&error).into()),
        }
        let Mp4 { whole, .. } = *self;
        Ok(whole.finish()?)
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::fs;
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    /// A program in the place of ffmpeg.
    fn stand_in(folder: &Path, script: &str) -> PathBuf {
        let path = folder.join("ffmpeg");
        fs::write(&path, format!("#!/bin/sh\n{script}\n")).expect("written");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).expect("made a program");
        path
    }

    #[test]
    fn ffmpeg_gets_all_frames_and_what_it_says_is_told() {
        let folder = std::env::temp_dir().join(format!("vrtm-view-mp4-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let path = folder.join("a.mp4");
        // It writes what it reads to the file that it is told last.
        let program = stand_in(&folder, "for last; do :; done; cat > \"$last\"");
        let mut film = Box::new(Mp4::new(&program, &path, [2, 1], 24).expect("started"));
        for value in [10, 20] {
            film.add(&[value; 8]).expect("added");
        }
        assert!(!path.exists());
        film.finish().expect("finished");
        assert_eq!(fs::read(&path).expect("read"), [[10; 8], [20; 8]].concat());
        let program = stand_in(&folder, "cat > /dev/null; echo 'no such encoder' >&2; exit 3");
        let film = Box::new(Mp4::new(&program, &path, [2, 1], 24).expect("started"));
        let said = film.finish().expect_err("it failed").to_string();
        assert_eq!(said, "ffmpeg: no such encoder");
        assert_eq!(fs::read_dir(&folder).expect("read").count(), 2, "the clip and the program");
        assert_eq!(fs::read(&path).expect("read").len(), 16, "the clip before stays");
        fs::remove_dir_all(&folder).expect("removed");
    }
}
