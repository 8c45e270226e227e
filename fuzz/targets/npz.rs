//! Scans in an archive of arrays; the archive itself is whole.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{archive, laid, scans};

fuzz_target!(|data: &[u8]| {
    let path = laid("anna_hips.npz", &archive(&["vertices", "faces", "fps"], data));
    scans(&path);
});
