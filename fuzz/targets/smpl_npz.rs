//! Body models in arrays; the archive itself is whole.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::{archive, body, laid};

fuzz_target!(|data: &[u8]| {
    let names =
        ["v_template", "f", "weights", "kintree_table", "J_regressor", "shapedirs", "posedirs", "vert_sym_idxs"];
    body(&laid("a.npz", &archive(&names, data)));
});
