//! Motions of AMASS's two generations; the archive itself is whole.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{archive, laid, motion};

fuzz_target!(|data: &[u8]| {
    let names: &[&str] = match data.first() {
        Some(1) => &["trans", "poses", "mocap_framerate"],
        _ => &["trans", "root_orient", "pose_body", "mocap_frame_rate"],
    };
    motion(&laid("a.npz", &archive(names, data)));
});
