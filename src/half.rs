//! Numbers of 16 bits: IEEE 754 binary16, converted with integer arithmetic alone so that every machine gives the same bits,
//! and bfloat16.

/// The f32 with the same value.
pub fn to_f32(h: u16) -> f32 {
    let sign = u32::from(h & 0x8000) << 16;
    let exponent = u32::from(h >> 10) & 0x1f;
    let mantissa = u32::from(h) & 0x3ff;
    match exponent {
        // 2^-24 times the mantissa is exact.
        0 => f32::from_bits(sign | (mantissa as f32 * f32::from_bits(0x3380_0000)).to_bits()),
        31 => f32::from_bits(sign | 0x7f80_0000 | (mantissa << 13)),
        _ => f32::from_bits(sign | ((exponent + 112) << 23) | (mantissa << 13)),
    }
}

/// The nearest half, ties to even; overflow gives infinity.
pub fn from_f32(value: f32) -> u16 {
    let bits = value.to_bits();
    let sign = ((bits >> 16) & 0x8000) as u16;
    let magnitude = bits & 0x7fff_ffff;
    if magnitude > 0x7f80_0000 {
        return sign | 0x7e00;
    }
    // 65520 and above round to infinity.
    if magnitude >= 0x477f_f000 {
        return sign | 0x7c00;
    }
    let exponent = (magnitude >> 23) as i32 - 127;
    let (mantissa, shift) = if exponent >= -14 {
        (magnitude & 0x007f_ffff | ((exponent + 15) as u32) << 23, 13)
    } else if exponent >= -25 {
        ((magnitude & 0x007f_ffff) | 0x0080_0000, (-1 - exponent) as u32)
    } else {
        return sign;
    };
    let kept = mantissa >> shift;
    let rest = mantissa & ((1 << shift) - 1);
    let tie = 1 << (shift - 1);
    let up = rest > tie || (rest == tie && kept & 1 == 1);
    sign | (kept + u32::from(up)) as u16
}

/// The f32 with the values of a word's upper and lower half, each a bfloat16: the first 16 bits of an f32.
pub fn of_bfloat16(word: u32) -> [f32; 2] {
    [word & 0xffff_0000, word << 16].map(f32::from_bits)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_survives_the_round_trip() {
        for h in 0..=u16::MAX {
            let value = to_f32(h);
            if value.is_nan() {
                assert!(to_f32(from_f32(value)).is_nan());
            } else {
                assert_eq!(from_f32(value), h, "{value}");
            }
        }
    }

    #[test]
    fn rounding_is_to_nearest_even() {
        // Between each pair of neighbours: a bit under the middle goes down, over it up, the middle to even.
        for h in 0..0x7bffu16 {
            let (low, high) = (to_f32(h), to_f32(h + 1));
            let middle = (low + high) / 2.0;
            assert_eq!(from_f32(middle), h + (h & 1), "{middle}");
            assert_eq!(from_f32(f32::from_bits(middle.to_bits() - 1)), h);
            assert_eq!(from_f32(f32::from_bits(middle.to_bits() + 1)), h + 1);
        }
        assert_eq!(from_f32(1e9), 0x7c00);
        assert_eq!(from_f32(-65520.0), 0xfc00);
    }
}
