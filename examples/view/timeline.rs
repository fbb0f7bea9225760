//! Where in the motion the view is: a frame between the first and the last, and whether it plays.

/// Frames from one key to the next, where their poses have no numbers, and from rest to the first pose.
const PER_KEY: usize = 24;
/// Frames per second, unless the user says otherwise.
pub const RATE: u16 = 24;

/// The timeline: frames from 1, with rest and all poses as keys.
#[derive(Clone, Debug)]
pub struct Timeline {
    /// Number of frames.
    pub last: usize,
    /// The present frame.
    pub frame: usize,
    /// Frames per second.
    pub rate: u16,
    /// The frame of each key; the first is rest.
    pub keys: Vec<usize>,
    /// Offset of frame numbers in the shot; `None` if the poses belong to no shot.
    offset: Option<i64>,
    /// Frame and time at which playing began.
    playing: Option<(usize, f64)>,
}

impl Timeline {
    /// `keys` counts rest and all poses.
    pub fn new(keys: usize) -> Timeline {
        Timeline::of((0..keys.max(1)).map(|k| 1 + k * PER_KEY).collect(), None)
    }

    /// The poses have the numbers of a shot, which ascend; the way from rest leads up to the first of them.
    pub fn of_shot(numbers: &[i64]) -> Timeline {
        let offset = numbers[0] - 1 - PER_KEY as i64;
        let poses = numbers.iter().map(|number| (number - offset) as usize);
        Timeline::of(std::iter::once(1).chain(poses).collect(), Some(offset))
    }

    fn of(keys: Vec<usize>, offset: Option<i64>) -> Timeline {
        Timeline { last: keys[keys.len() - 1], frame: 1, rate: RATE, keys, offset, playing: None }
    }

    /// The number that a frame has in its shot.
    pub fn number(&self, frame: usize) -> i64 {
        frame as i64 + self.offset.unwrap_or(0)
    }

    /// The name of a pose's key: its number in the shot, or among the poses.
    pub fn label(&self, key: usize) -> String {
        match self.offset {
            None => key.to_string(),
            Some(_) => self.number(self.keys[key]).to_string(),
        }
    }

    /// The frame with a number.
    pub fn frame_of(&self, number: i64) -> usize {
        (number - self.offset.unwrap_or(0)).clamp(1, self.last as i64) as usize
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
            let passed = ((now - start).max(0.0) * f64::from(self.rate)) as usize;
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
    fn frames_of_a_shot_have_its_numbers() {
        let line = Timeline::of_shot(&[1001, 1002, 1005]);
        assert_eq!((line.last, line.keys.clone()), (29, vec![1, 25, 26, 29]));
        assert_eq!([1, 25, 29].map(|frame| line.number(frame)), [977, 1001, 1005]);
        assert_eq!([0, 1002, 2000].map(|number| line.frame_of(number)), [1, 26, 29]);
    }

    #[test]
    fn rest_alone_is_one_frame() {
        let mut line = Timeline::new(1);
        line.toggle(0.0);
        line.tick(3.0);
        assert_eq!((line.frame, line.last), (1, 1));
    }

    #[test]
    fn it_plays_by_the_clock_and_begins_again_after_the_last_frame() {
        let mut line = Timeline::new(2);
        line.go(24);
        line.toggle(10.0);
        line.tick(10.0 + 1.01 / 24.0);
        assert_eq!((line.frame, line.is_playing()), (25, true));
        line.tick(10.0 + 2.01 / 24.0);
        assert_eq!(line.frame, 1);
        line.rate = 12;
        line.tick(10.0 + 2.01 / 24.0);
        assert_eq!(line.frame, 25);
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
