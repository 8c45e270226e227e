//! Motions in BVH.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{laid, motion};

fuzz_target!(|data: &[u8]| motion(&laid("a.bvh", data)));
