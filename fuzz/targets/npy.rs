//! Single arrays.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{laid, told};
use softtissue_import::arrays::{ArrayLimits, read_npy};

fuzz_target!(|data: &[u8]| {
    let path = laid("a.npy", data);
    if let Some(array) = told(&path, read_npy(&path, &ArrayLimits::default())) {
        let numbers = told(&path, array.f64s());
        assert!(numbers.is_none_or(|n| n.len() == array.len() && n.iter().all(|x| x.is_finite())));
        told(&path, array.f32s());
        told(&path, array.integers());
        told(&path, array.number());
        told(&path, array.texts());
        told(&path, array.text());
    }
});
