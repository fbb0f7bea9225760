//! A smooth path of poses through rest and all frames of a model: for the viewer's timeline.

/// A cubic Hermite spline in time (Catmull-Rom with tangents for uneven times), at rest at both ends: its velocity is
/// continuous, and it passes exactly through each key.
pub struct Path<'a> {
    keys: Vec<&'a [[f32; 3]]>,
    /// The frame of each key, from 1.
    pub times: Vec<usize>,
}

impl<'a> Path<'a> {
    /// A path that passes through each key at its frame; the frames ascend from 1.
    ///
    /// # Errors
    /// If there are not as many frames as keys, or fewer than two.
    pub fn through(keys: Vec<&'a [[f32; 3]]>, times: &[usize]) -> Result<Path<'a>, String> {
        if keys.len() < 2 || times.len() != keys.len() {
            return Err(format!("{} frames for {} keys", times.len(), keys.len()));
        }
        Ok(Path { keys, times: times.to_vec() })
    }

    /// The pose of a frame, numbered from 1, rounded to f32 as hosts hand it over.
    pub fn pose(&self, frame: usize) -> Vec<[f32; 3]> {
        let before = self.times[1..self.times.len() - 1].iter().filter(|&&time| time <= frame).count();
        let time = |k: usize| self.times[k] as f64;
        let span = time(before + 1) - time(before);
        let s = (frame as f64 - time(before)) / span;
        let (s2, s3) = (s * s, s * s * s);
        let weights = [2.0 * s3 - 3.0 * s2 + 1.0, 3.0 * s2 - 2.0 * s3];
        let slopes = [s3 - 2.0 * s2 + s, s3 - s2].map(|x| x * span);
        let at = |v: usize, c: usize| {
            let ends = [before, before + 1];
            let position = |k: usize| f64::from(self.keys[k][v][c]);
            let sum: f64 = (0..2).map(|e| weights[e] * position(ends[e])).sum();
            let moved: f64 = (0..2).map(|e| slopes[e] * self.velocity(ends[e], v, c)).sum();
            (sum + moved) as f32
        };
        (0..self.keys[0].len()).map(|v| [0, 1, 2].map(|c| at(v, c))).collect()
    }

    /// Velocity of a coordinate at a key: the slopes on both sides, each weighted with the other's length.
    fn velocity(&self, key: usize, v: usize, c: usize) -> f64 {
        if key == 0 || key + 1 == self.keys.len() {
            return 0.0;
        }
        let part = |k: usize| {
            let span = (self.times[k + 1] - self.times[k]) as f64;
            let way = f64::from(self.keys[k + 1][v][c]) - f64::from(self.keys[k][v][c]);
            (span, way / span)
        };
        let [(a, left), (b, right)] = [part(key - 1), part(key)];
        (b * left + a * right) / (a + b)
    }
}
