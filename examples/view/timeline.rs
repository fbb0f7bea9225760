//! Where in the motion the view is: a frame between the first and the last, and whether it plays.

/// Frames from one key to the next.
const PER_KEY: usize = 24;
/// Frames per second.
pub const RATE: f64 = 24.0;

/// The timeline: frames from 1, with rest and all poses as keys.
#[derive(Clone, Debug)]
pub struct Timeline {
    /// Number of frames.
    pub last: usize,
    /// The present frame.
    pub frame: usize,
    /// The frame of each key; the first is rest.
    pub keys: Vec<usize>,
    /// Where and when playing began.
    playing: Option<(usize, f64)>,
}

impl Timeline {
    /// `keys` counts rest and all poses.
    pub fn new(keys: usize) -> Timeline {
        let keys: Vec<usize> = (0..keys.max(1)).map(|k| 1 + k * PER_KEY).collect();
        Timeline { last: keys[keys.len() - 1], frame: 1, keys, playing: None }
    }

    /// Goes to a frame and stops there.
    pub fn go(&mut self, frame: usize) {
        self.frame = frame.clamp(1, self.last);
        self.playing = None;
    }

    pub fn is_playing(&self) -> bool {
        self.playing.is_some()
    }

    /// Plays or stops; `now` in seconds.
    pub fn toggle(&mut self, now: f64) {
        self.playing = if self.is_playing() { None } else { Some((self.frame, now)) };
    }

    /// Moves on while playing: by the clock, so that a slow solve skips frames instead of slowing the motion down.
    pub fn tick(&mut self, now: f64) {
        if let Some((first, start)) = self.playing {
            let passed = ((now - start).max(0.0) * RATE) as usize;
            self.frame = 1 + (first - 1 + passed) % self.last;
        }
    }

    /// The key before this frame, or after it.
    pub fn step_to_key(&mut self, forward: bool) {
        let key = if forward {
            self.keys.iter().find(|&&key| key > self.frame)
        } else {
            self.keys.iter().rev().find(|&&key| key < self.frame)
        };
        if let Some(&key) = key {
            self.go(key);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_stay_inside() {
        let mut line = Timeline::new(3);
        assert_eq!((line.last, line.keys.clone()), (49, vec![1, 25, 49]));
        line.go(0);
        assert_eq!(line.frame, 1);
        line.go(1000);
        assert_eq!(line.frame, 49);
    }

    #[test]
    fn it_plays_by_the_clock_and_begins_again_after_the_last_frame() {
        let mut line = Timeline::new(2);
        line.go(24);
        line.toggle(10.0);
        line.tick(10.0 + 1.01 / RATE);
        assert_eq!((line.frame, line.is_playing()), (25, true));
        line.tick(10.0 + 2.01 / RATE);
        assert_eq!(line.frame, 1);
        line.go(5);
        line.tick(12.0);
        assert_eq!((line.frame, line.is_playing()), (5, false));
    }

    #[test]
    fn steps_lead_to_keys() {
        let mut line = Timeline::new(3);
        line.go(30);
        line.step_to_key(false);
        assert_eq!(line.frame, 25);
        line.step_to_key(false);
        line.step_to_key(false);
        assert_eq!(line.frame, 1);
        line.step_to_key(true);
        assert_eq!(line.frame, 25);
    }
}
