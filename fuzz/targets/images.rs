#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| vrtm_fuzz::images::run(bytes));
