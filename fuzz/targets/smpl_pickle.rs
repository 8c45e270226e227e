//! Body models in a pickle.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{body, laid};

fuzz_target!(|data: &[u8]| body(&laid("a.pkl", data)));
