//! OBJ frames in their own order, and meshes through `tobj`.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{laid, told};
use softtissue_import::{ImportLimits, read_mesh, read_obj_frame};

fuzz_target!(|data: &[u8]| {
    let path = laid("a.obj", data);
    let limits = ImportLimits::default();
    if let Some(frame) = told(&path, read_obj_frame(&path, &limits)) {
        let count = frame.positions.len();
        assert!(frame.positions.iter().all(|p| p.is_finite()));
        assert!(frame.faces.iter().flatten().all(|i| (*i as usize) < count));
        assert!(frame.colors.is_empty() || frame.colors.len() == count);
    }
    if let Some(mesh) = told(&path, read_mesh(&path, &limits)) {
        assert!(mesh.positions.iter().all(|p| p.is_finite()));
        assert!(mesh.topology.faces.iter().flatten().all(|i| (*i as usize) < mesh.positions.len()));
    }
});
