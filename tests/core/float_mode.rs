use vrtm_core::float_mode::{DEFAULT, FloatMode, Word, read, write};

/// Rounds up, flushes results to zero, treats subnormal operands as zero, and traps divisions by zero.
const ODD: Word = (DEFAULT & !(1 << 9)) | 0x4000 | 0x8000 | 0x40;

#[test]
fn a_mode_is_set_and_restored_even_by_a_panic() {
    for panics in [false, true] {
        let before = read();
        write(ODD);
        let mut inside = None;
        let caught = vrtm_core::unwind::hold_back(|| {
            let _mode = FloatMode::set_default();
            inside = Some((read(), std::thread::spawn(read).join().unwrap()));
            assert!(!panics, "inside");
        });
        let after = read();
        write(before);
        assert_eq!((inside, after, caught.is_err()), (Some((DEFAULT, DEFAULT)), ODD, panics));
    }
}
