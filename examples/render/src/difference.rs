//! Measures the difference between two pictures.

/// Differences, of 255, of the pixels where both pictures show the mesh; the worst channel of each pixel counts.
#[derive(Clone, Copy, Debug)]
pub struct Difference {
    pub mean: f64,
    /// The value that 99 % of the pixels do not exceed.
    pub p99: u8,
    pub max: u8,
}

/// Compares two pictures whose alpha is 255 where they show the mesh.
pub fn difference(a: &[u8], b: &[u8]) -> Difference {
    let mut counts = [0u64; 256];
    for (a, b) in a.chunks_exact(4).zip(b.chunks_exact(4)).filter(|(a, b)| a[3] == 255 && b[3] == 255) {
        let worst = (0..3).map(|c| a[c].abs_diff(b[c])).fold(0, u8::max);
        counts[usize::from(worst)] += 1;
    }
    let all: u64 = counts.iter().sum();
    let sum: u64 = (0..).zip(&counts).map(|(value, count)| value * count).sum();
    // The least value that at least the fraction `part` of the pixels does not exceed.
    let at = |part: f64| {
        let mut seen = 0;
        let reached = |count: &u64| {
            seen += count;
            seen as f64 >= part * all as f64
        };
        counts.iter().position(reached).unwrap_or(0) as u8
    };
    Difference { mean: sum as f64 / all.max(1) as f64, p99: at(0.99), max: at(1.0) }
}

/// The difference as a picture: grey where both are equal, brighter or darker elsewhere, amplified three times.
pub fn picture(a: &[u8], b: &[u8]) -> Vec<u8> {
    let value = |(a, b): (&u8, &u8)| (127 + 3 * (i32::from(*a) - i32::from(*b))).clamp(0, 255) as u8;
    let mut texels: Vec<u8> = a.iter().zip(b).map(value).collect();
    texels.chunks_exact_mut(4).for_each(|texel| texel[3] = 255);
    texels
}
