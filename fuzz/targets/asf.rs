//! Acclaim's skeletons, below a motion that is whole.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{acclaim, laid};

fuzz_target!(|data: &[u8]| acclaim(laid("a.asf", data), laid("a.amc", include_bytes!("../corpus/amc/01_01.amc"))));
