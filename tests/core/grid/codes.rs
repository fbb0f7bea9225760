use vrtm_core::grid::codes::*;

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
