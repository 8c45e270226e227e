//! Pickles, and the arrays in them.

#![no_main]

use libfuzzer_sys::fuzz_target;
use softtissue_fuzz::sentence;
use softtissue_import::Place;
use softtissue_import::arrays::ArrayLimits;
use softtissue_import::pickle::{Pickle, PickleLimits, PickledArrays, SparseRows};
use std::path::Path;

fuzz_target!(|data: &[u8]| {
    let path = Path::new("a.pkl");
    let Ok(pickle) = Pickle::read(data, &PickleLimits::default()) else { return };
    let arrays = PickledArrays { pickle: &pickle, limits: &ArrayLimits::default() };
    let root = pickle.root();
    let named = pickle.keys(root).into_iter().take(40).filter_map(|key| pickle.value(root, key));
    for id in named.chain([root]) {
        match arrays.array(id, &Place::file(path)) {
            Ok(array) => {
                let _ = (array.f64s(), array.integers(), array.texts());
            }
            Err(e) => sentence(path, &e.to_string()),
        }
        let _ = SparseRows::read(&arrays, id, &Place::file(path));
    }
});
