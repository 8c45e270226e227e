//! Acclaim's motions, on a skeleton that is whole.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{acclaim, laid};

fuzz_target!(|data: &[u8]| acclaim(laid("a.asf", include_bytes!("../corpus/asf/01.asf")), laid("a.amc", data)));
