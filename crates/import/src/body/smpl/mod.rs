//! SMPL (Loper et al. 2015) and its kin: `.pkl` as released (protocol 2 of Python 2, chumpy and SciPy inside; nothing in
//! it is executed) and `.npz` of SMPL, SMPL-H and SMPL-X. Arrays are taken as they are; what the files lack is derived:
//! symmetry where there is no `vert_sym_idxs`, regions, no texture coordinates.
//!
//! Not done: STAR (its pose features are quaternions), DMPL's own directions, hand components, expressions.

mod convert;
mod fields;
mod joints;

use super::ImportedBody;
use crate::arrays::{ArrayLimits, Npz};
use crate::pickle::{Pickle, PickleLimits, PickledArrays};
use crate::{ImportError, Place, Result};
use fields::Fields;
use softtissue_store::read_limited;
use std::path::Path;

/// How a body model is taken in.
#[derive(Clone, Copy, Debug)]
pub struct SmplConfig {
    /// Shape coefficients to keep. Default 10; a file may have fewer.
    pub shapes: usize,
    /// Keep every joint; otherwise (the default) fingers, jaw and eyes are folded into SMPL's 24.
    pub keep_joints: bool,
    /// Limits of arrays.
    pub arrays: ArrayLimits,
    /// Limits of pickles.
    pub pickle: PickleLimits,
}

impl Default for SmplConfig {
    fn default() -> Self {
        Self { shapes: 10, keep_joints: false, arrays: ArrayLimits::default(), pickle: PickleLimits::default() }
    }
}

/// Reads a body model from a `.pkl` or `.npz` file; which of the two it is its first bytes say.
///
/// # Errors
/// Neither of the two, a part that is missing, damaged or of another shape, numbers that are not finite, a body outside
/// of human size, or a mesh without symmetry.
pub fn import_smpl(path: &Path, config: &SmplConfig) -> Result<ImportedBody> {
    let bytes = read_limited(path, config.arrays.file_bytes)?;
    if bytes.starts_with(b"PK") {
        drop(bytes);
        let npz = Npz::open(path, &config.arrays)?;
        return convert::convert(&Fields::Npz { npz: &npz, config }, config);
    }
    // Protocol 2 and later say so, protocol 0 begins with a dictionary in text.
    if !bytes.starts_with(b"\x80") && !bytes.starts_with(b"(d") && !bytes.starts_with(b"ccopy_reg") {
        let reason = "it is neither a pickle nor an npz archive; give SMPL as .pkl or .npz, Anny with --anny";
        return Err(ImportError::file(path, reason));
    }
    let place = Place::part(path, "pickle");
    let pickle = Pickle::read(&bytes, &config.pickle).map_err(|reason| place.refuse(reason))?;
    let arrays = PickledArrays { pickle: &pickle, limits: &config.arrays };
    convert::convert(&Fields::Pickle { arrays, path }, config)
}
