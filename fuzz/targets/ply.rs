//! PLY frames.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{laid, told};
use softtissue_import::ImportLimits;
use softtissue_import::scans::read_ply;

fuzz_target!(|data: &[u8]| {
    let path = laid("a.ply", data);
    if let Some(mesh) = told(&path, read_ply(&path, &ImportLimits::default())) {
        let count = mesh.positions.len();
        assert!(mesh.positions.iter().chain(&mesh.normals).all(|p| p.is_finite()));
        assert!(mesh.normals.is_empty() || mesh.normals.len() == count);
        assert!(mesh.faces.iter().flatten().all(|i| (*i as usize) < count));
    }
});
