//! 64-bit FNV-1a, in which `tests/bits.txt` holds results.

pub struct Hash(pub u64);

impl Default for Hash {
    fn default() -> Hash {
        Hash(0xcbf2_9ce4_8422_2325)
    }
}

impl Hash {
    pub fn byte(&mut self, byte: u8) {
        self.0 = (self.0 ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }

    pub fn add(&mut self, x: u64) {
        x.to_le_bytes().into_iter().for_each(|byte| self.byte(byte));
    }
}
