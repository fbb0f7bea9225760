//! A grid's constants in few bytes: they are most of what a solve reads, beside its own state.

/// The code of 1 in `share`.
pub const SHARES: f32 = 65535.0;

/// A number from 0 to 1 in steps of 1 / `SHARES`.
pub fn share(x: f32) -> u16 {
    // What is not a number becomes 0.
    (x.clamp(0.0, 1.0) * SHARES + 0.5) as u16
}

/// What `share` kept: 0 and 1 exactly.
#[cfg(any(test, feature = "gpu"))]
pub fn of_share(code: u16) -> f32 {
    f32::from(code) / SHARES
}

/// A weight from 0 to 1 in steps of 1/254: one half is among them.
pub fn weight(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 254.0 + 0.5) as u8
}

/// What `weight` kept: 0, 1/2 and 1 exactly.
pub fn of_weight(code: u8) -> f32 {
    f32::from(code) / 254.0
}

/// Lengths between two bounds, and 0: as many of the leading bits of what their f32 differ from the lower bound's as 16 bits
/// hold. Where the longest is twice the shortest, errors are up to 2e-5 of a length; ten times: 6e-5; a thousand times: 1e-4.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lengths {
    /// The code n > 0 stands for the f32 with the bits (n << shift) + base, wrapped; 0 for 0.
    pub base: u32,
    pub shift: u32,
}

impl Lengths {
    /// For lengths from `low` to `high`. Shorter ones become 0, longer ones the longest.
    pub fn between(low: f32, high: f32) -> Lengths {
        let [low, high] = [low, high.max(low)].map(f32::to_bits);
        // The first code is 1, and rounding may take the longest length a code up.
        let shift = (0..32).find(|shift| (u64::from(high - low) >> shift) + 2 <= u64::from(u16::MAX));
        let shift = shift.unwrap_or_default();
        Lengths { base: low.wrapping_sub(1 << shift), shift }
    }

    pub fn code(self, length: f32) -> u16 {
        let beyond = i64::from(length.to_bits()) - i64::from(self.base.wrapping_add(1 << self.shift));
        if beyond < 0 {
            return 0;
        }
        (1 + ((beyond + (1 << self.shift >> 1)) >> self.shift)).min(i64::from(u16::MAX)) as u16
    }

    #[cfg(any(test, feature = "gpu"))]
    pub fn length(self, code: u16) -> f32 {
        match code {
            0 => 0.0,
            _ => f32::from_bits((u32::from(code) << self.shift).wrapping_add(self.base)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_weights_survive_the_round_trip() {
        for code in 0..=u16::MAX {
            assert_eq!(share(of_share(code)), code);
        }
        for code in 0..=254 {
            assert_eq!(weight(of_weight(code)), code);
        }
        for (x, y) in [(0.0, 0.0), (1.0, 1.0), (-1.0, 0.0), (2.0, 1.0), (f32::NAN, 0.0)] {
            assert_eq!([of_share(share(x)), of_weight(weight(x))], [y; 2]);
        }
        assert_eq!(of_weight(weight(0.5)), 0.5);
        // A map of 8 bits.
        for byte in 0..=u8::MAX {
            let x = f32::from(byte) / 255.0;
            assert_eq!(of_share(share(x)), x);
        }
    }

    #[test]
    fn a_length_loses_less_the_closer_its_bounds_are() {
        for (ratio, error) in [(1.0, 0.0), (2.0, 1.6e-5), (10.0, 6.2e-5), (1e3, 1.3e-4), (1e30, 1e-3)] {
            let (low, high) = (0.013f32, 0.013 * ratio);
            let lengths = Lengths::between(low, high);
            for k in 0..=1000 {
                let x = low * (f64::from(ratio).powf(f64::from(k) / 1000.0) as f32);
                let kept = lengths.length(lengths.code(x));
                assert!(((kept - x) / x).abs() <= error, "{ratio}: {x} became {kept}");
            }
            assert_eq!([0.0, 0.99 * low].map(|x| lengths.length(lengths.code(x))), [0.0; 2]);
            let top = lengths.length(lengths.code(2.0 * high));
            assert!(top.is_finite() && top >= high && f64::from(top) <= 2.01 * f64::from(high), "{top}");
        }
        let none = Lengths::between(f32::INFINITY, 0.0);
        assert_eq!(none.length(none.code(0.0)), 0.0);
    }
}
