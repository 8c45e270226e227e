//! Foreign motions on a bundle's body, for programs that let people bring their own.

use crate::{SharedBundle, array, call, object, text};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_import::motion::{MotionConfig, RetargetConfig, read_bvh_bytes, resample, retarget};
use std::ffi::{CString, c_char};
use std::path::Path;

/// `softtissue_motion`.
pub struct OwnMotion {
    rotations: Vec<f32>,
    translations: Vec<f32>,
    facts: CString,
}

/// See the header.
///
/// # Safety
/// `bundle` is NULL or open; `shape` has `shape_count` numbers, `bytes` as many as `size` says; `name` is NULL or a text
/// that ends in zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_motion_from_bvh(
    bundle: *const SharedBundle,
    shape: *const f32,
    shape_count: usize,
    name: *const c_char,
    bytes: *const u8,
    size: usize,
) -> *mut OwnMotion {
    call(std::ptr::null_mut(), || {
        // SAFETY: the caller's.
        let (bundle, shape) = unsafe { (object(bundle, "bundle")?, array(shape, shape_count, "shape")?) };
        // SAFETY: the caller's.
        let (name, bytes) = unsafe { (text(name, "name")?, array(bytes, size, "bytes")?) };
        let (body, fps) = (&bundle.0.body, bundle.0.descriptor.fps);
        let path = Path::new(name);
        let said = |e: softtissue_import::ImportError| e.to_string();
        let read = read_bvh_bytes(path, bytes, &MotionConfig::default()).map_err(said)?;
        let id = ClipId::new("imported", "motion", 0);
        let moved = retarget(path, &read, id, &body.skeleton, &body.shaped(shape), &RetargetConfig::default());
        let moved = moved.map_err(said)?;
        let clip = resample(&moved.clip, fps, path).map_err(said)?;
        let facts = [vec![read.facts.sentence()], moved.notes].concat().join("; ");
        Ok(Box::into_raw(Box::new(OwnMotion::of(&clip, &facts))))
    })
}

impl OwnMotion {
    fn of(clip: &MotionClip, facts: &str) -> Self {
        Self {
            rotations: clip.rotations.to_numbers(),
            translations: clip.translations.iter().flat_map(|p| p.to_array()).collect(),
            facts: CString::new(facts.replace('\0', " ")).unwrap_or_default(),
        }
    }
}

/// See the header.
///
/// # Safety
/// `motion` is NULL or of `softtissue_motion_from_bvh`, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_motion_free(motion: *mut OwnMotion) {
    if !motion.is_null() {
        // SAFETY: it came out of a box, and nobody has it any more.
        let own = unsafe { Box::from_raw(motion) };
        call((), || {
            drop(own);
            Ok(())
        });
    }
}

/// See the header.
///
/// # Safety
/// `motion` is NULL or living.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_motion_length(motion: *const OwnMotion) -> usize {
    // SAFETY: the caller's.
    call(0, || Ok(unsafe { object(motion, "motion") }?.translations.len() / 3))
}

macro_rules! motion_facts {
    ($($name:ident: $kind:ty = $fact:expr;)*) => {$(
        /// See the header.
        ///
        /// # Safety
        /// `motion` is NULL or living.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(motion: *const OwnMotion) -> *const $kind {
            let fact: fn(&OwnMotion) -> *const $kind = $fact;
            // SAFETY: the caller's.
            call(std::ptr::null(), || Ok(fact(unsafe { object(motion, "motion") }?)))
        }
    )*};
}
motion_facts! {
    softtissue_motion_rotations: f32 = |m| m.rotations.as_ptr();
    softtissue_motion_translations: f32 = |m| m.translations.as_ptr();
    softtissue_motion_facts: c_char = |m| m.facts.as_ptr();
}
