#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| frhc_fuzz::sdo_server(bytes));
