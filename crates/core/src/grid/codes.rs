//! Codes of 8 and 16 bits for rigidity, weights of interpolation and rest lengths (method §1): besides its own state, a
//! solve reads mostly these constants.

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

/// The two numbers in a word (method §7.2): the whole word as f32, and its lower half as bfloat16.
#[inline(always)]
pub fn unpack_two(word: u32) -> [f32; 2] {
    [word, word << 16].map(f32::from_bits)
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
