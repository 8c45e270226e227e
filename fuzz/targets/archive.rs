//! Zip archives, bytes as they come: most inputs end at a checksum, but the lists of members are read.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{laid, told};
use softtissue_import::arrays::{ArrayLimits, Npz};

fuzz_target!(|data: &[u8]| {
    let path = laid("a.npz", data);
    if let Some(npz) = told(&path, Npz::open(&path, &ArrayLimits::default())) {
        for name in npz.names() {
            if let Some(array) = told(&path, npz.require(name)) {
                told(&path, array.f64s());
            }
        }
    }
});
