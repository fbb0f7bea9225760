//! Codes of 8 and 16 bits for rigidity, weights of interpolation and rest lengths (method §1): besides its own state, a
//! solve reads mostly these constants.

use half::bf16;

/// The code of 1 in `encode_rigidity`.
pub const RIGIDITY_STEPS: f32 = 65535.0;

/// The code of a number from 0 to 1, in steps of 1 / `RIGIDITY_STEPS`.
pub fn encode_rigidity(x: f32) -> u16 {
    // NaN becomes 0.
    (x.clamp(0.0, 1.0) * RIGIDITY_STEPS + 0.5) as u16
}

/// Decodes a number from `encode_rigidity`; 0 and 1 are exact.
pub fn decode_rigidity(code: u16) -> f32 {
    f32::from(code) / RIGIDITY_STEPS
}

/// The code of a weight from 0 to 1, in steps of 1/254, so that one half is exact.
pub fn encode_weight(x: f32) -> u8 {
    (x.clamp(0.0, 1.0) * 254.0 + 0.5) as u8
}

/// Decodes a weight from `encode_weight`; 0, 1/2 and 1 are exact.
pub fn decode_weight(code: u8) -> f32 {
    f32::from(code) / 254.0
}

/// The two bfloat16 in a word: the upper half first, then the lower half.
#[inline(always)]
pub fn unpack_bfloat16(word: u32) -> [f32; 2] {
    [(word >> 16) as u16, word as u16].map(|bits| bf16::from_bits(bits).to_f32())
}

/// A 16-bit coding of 0 and of lengths between two bounds: the leading bits of the difference between the f32
/// representations of the length and of the lower bound. The relative error is at most 1.6e-5 if the longest length is
/// twice the shortest, 6.2e-5 if it is ten times, and 1.3e-4 if it is a thousand times the shortest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Lengths {
    /// The code n > 0 represents the f32 with the bits (n << shift) + base, in wrapping arithmetic; 0 represents 0.
    pub base: u32,
    pub shift: u32,
}

impl Lengths {
    /// The coding of lengths from `low` to `high`. Shorter lengths become 0; longer ones become the length of the
    /// greatest code.
    pub fn between(low: f32, high: f32) -> Lengths {
        let [low, high] = [low, high.max(low)].map(f32::to_bits);
        // Codes begin at 1, and rounding may raise the code of the longest length by 1.
        let shift = (0..32).find(|shift| (u64::from(high - low) >> shift) + 2 <= u64::from(u16::MAX));
        let shift = shift.unwrap_or_default();
        Lengths { base: low.wrapping_sub(1 << shift), shift }
    }

    pub fn code(self, length: f32) -> u16 {
        let excess = i64::from(length.to_bits()) - i64::from(self.base.wrapping_add(1 << self.shift));
        if excess < 0 {
            return 0;
        }
        (1 + ((excess + (1 << self.shift >> 1)) >> self.shift)).min(i64::from(u16::MAX)) as u16
    }

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
    fn rigidities_and_weights_survive_the_round_trip() {
        for code in 0..=u16::MAX {
            assert_eq!(encode_rigidity(decode_rigidity(code)), code);
        }
        for code in 0..=254 {
            assert_eq!(encode_weight(decode_weight(code)), code);
        }
        for (x, y) in [(0.0, 0.0), (1.0, 1.0), (-1.0, 0.0), (2.0, 1.0), (f32::NAN, 0.0)] {
            assert_eq!([decode_rigidity(encode_rigidity(x)), decode_weight(encode_weight(x))], [y; 2]);
        }
        assert_eq!(decode_weight(encode_weight(0.5)), 0.5);
        // The values of an 8-bit map.
        for byte in 0..=u8::MAX {
            let x = f32::from(byte) / 255.0;
            assert_eq!(decode_rigidity(encode_rigidity(x)), x);
        }
    }

    #[test]
    fn a_length_loses_less_the_closer_its_bounds_are() {
        for (ratio, error) in [(1.0, 0.0), (2.0, 1.6e-5), (10.0, 6.2e-5), (1e3, 1.3e-4), (1e30, 1e-3)] {
            let (low, high) = (0.013f32, 0.013 * ratio);
            let lengths = Lengths::between(low, high);
            for k in 0..=1000 {
                let x = low * (f64::from(ratio).powf(f64::from(k) / 1000.0) as f32);
                let decoded = lengths.length(lengths.code(x));
                assert!(((decoded - x) / x).abs() <= error, "{ratio}: {x} became {decoded}");
            }
            assert_eq!([0.0, 0.99 * low].map(|x| lengths.length(lengths.code(x))), [0.0; 2]);
            let top = lengths.length(lengths.code(2.0 * high));
            assert!(top.is_finite() && top >= high && f64::from(top) <= 2.01 * f64::from(high), "{top}");
        }
        let none = Lengths::between(f32::INFINITY, 0.0);
        assert_eq!(none.length(none.code(0.0)), 0.0);
    }
}
