//! Scans in HDF5.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{laid, scans};

fuzz_target!(|data: &[u8]| scans(&laid("a.hdf5", data)));
