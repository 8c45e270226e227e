//! The player as a C library; `include/softtissue.h` is its documentation.
//!
//! The only room with `unsafe`: pointers come from outside. Every function checks them for null, takes the lengths that the
//! header states, and lets no panic out.
#![expect(unsafe_code, reason = "a C interface is made of pointers; tests/program.rs runs it from C")]

#[cfg(feature = "motion")]
mod motion;
#[cfg(target_family = "wasm")]
mod page;

use glam::Vec3;
use softtissue_body::{Pose, Region};
use softtissue_bundle::{Bundle, BundleError, BundleFiles, Control, Controls, Detail, Fade, Player, StepReport};
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char, c_int};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

/// `softtissue_bundle`.
pub struct SharedBundle(Arc<Bundle>);

/// `softtissue_player`.
pub struct OwnPlayer {
    player: Player<Arc<Bundle>>,
    controls: Controls,
    rotations: Vec<Vec3>,
}

/// `SOFTTISSUE_FAILED`.
const FAILED: u32 = 1 << 30;

thread_local! {
    static ERROR: RefCell<CString> = RefCell::default();
}

/// Runs a call; what goes wrong in it becomes the thread's error and `otherwise`.
fn call<T>(otherwise: T, work: impl FnOnce() -> Result<T, String>) -> T {
    let message = match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(value)) => return value,
        Ok(Err(message)) => message,
        Err(_) => "the player failed inside; please report it with the bundle and the motion".into(),
    };
    let message = CString::new(message.replace('\0', " ")).unwrap_or_default();
    ERROR.with(|error| *error.borrow_mut() = message);
    otherwise
}

/// # Safety
/// A pointer that is not null points to a living `T`.
unsafe fn object<'a, T>(pointer: *const T, name: &str) -> Result<&'a T, String> {
    // SAFETY: the caller's.
    unsafe { pointer.as_ref() }.ok_or_else(|| format!("{name} is NULL"))
}

/// # Safety
/// A pointer that is not null points to a living `T` that nobody else uses.
unsafe fn own<'a, T>(pointer: *mut T, name: &str) -> Result<&'a mut T, String> {
    // SAFETY: the caller's.
    unsafe { pointer.as_mut() }.ok_or_else(|| format!("{name} is NULL"))
}

/// # Safety
/// A pointer that is not null points to a text that ends in zero.
unsafe fn text<'a>(pointer: *const c_char, name: &str) -> Result<&'a str, String> {
    if pointer.is_null() {
        return Err(format!("{name} is NULL"));
    }
    // SAFETY: not null; the rest is the caller's.
    unsafe { CStr::from_ptr(pointer) }.to_str().map_err(|_| format!("{name} is not UTF-8"))
}

/// # Safety
/// A pointer that is not null points to `count` values.
unsafe fn array<'a, T>(pointer: *const T, count: usize, name: &str) -> Result<&'a [T], String> {
    match (pointer.is_null(), count) {
        (_, 0) => Ok(&[]),
        (true, _) => Err(format!("{name} is NULL")),
        // SAFETY: not null; the rest is the caller's.
        (false, _) => Ok(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

fn said(error: BundleError) -> String {
    error.to_string()
}

/// See the header.
///
/// # Safety
/// `folder` is NULL or a text that ends in zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_bundle_open(folder: *const c_char) -> *mut SharedBundle {
    call(std::ptr::null_mut(), || {
        // SAFETY: the caller's.
        let folder = unsafe { text(folder, "folder") }?;
        let bundle = Bundle::read(Path::new(folder)).map_err(said)?;
        Ok(Box::into_raw(Box::new(SharedBundle(Arc::new(bundle)))))
    })
}

/// See the header.
///
/// # Safety
/// Each file is NULL or has as many bytes as the number after it says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_bundle_from_memory(
    manifest: *const u8,
    manifest_size: usize,
    body: *const u8,
    body_size: usize,
    model: *const u8,
    model_size: usize,
) -> *mut SharedBundle {
    call(std::ptr::null_mut(), || {
        // SAFETY: the caller's.
        let files = unsafe {
            BundleFiles {
                manifest: array(manifest, manifest_size, "manifest")?.to_vec(),
                body: array(body, body_size, "body")?.to_vec(),
                model: array(model, model_size, "model")?.to_vec(),
            }
        };
        let bundle = Bundle::from_memory(files).map_err(said)?;
        Ok(Box::into_raw(Box::new(SharedBundle(Arc::new(bundle)))))
    })
}

/// See the header.
///
/// # Safety
/// `bundle` is NULL or of `softtissue_bundle_open` or `softtissue_bundle_from_memory`, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_bundle_close(bundle: *mut SharedBundle) {
    if !bundle.is_null() {
        // SAFETY: it came out of a box, and nobody has it any more.
        let own = unsafe { Box::from_raw(bundle) };
        call((), || {
            drop(own);
            Ok(())
        });
    }
}

/// Something of a bundle; `T::default()` of NULL.
///
/// # Safety
/// `bundle` is NULL or open.
unsafe fn of_bundle<T: Default>(bundle: *const SharedBundle, what: impl FnOnce(&Bundle) -> T) -> T {
    call(T::default(), || {
        // SAFETY: the caller's.
        Ok(what(&unsafe { object(bundle, "bundle") }?.0))
    })
}

macro_rules! bundle_facts {
    ($($name:ident: $kind:ty = $fact:expr;)*) => {$(
        /// See the header.
        ///
        /// # Safety
        /// `bundle` is NULL or open.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $name(bundle: *const SharedBundle) -> $kind {
            // SAFETY: the caller's.
            unsafe { of_bundle(bundle, $fact) }
        }
    )*};
}
bundle_facts! {
    softtissue_vertex_count: usize = |b| b.body.vertex_count();
    softtissue_joint_count: usize = |b| b.body.joint_count();
    softtissue_face_count: usize = |b| b.body.topology.faces.len();
    softtissue_shape_count: usize = |b| b.body.shape_count();
    softtissue_frames_per_second: f32 = |b| b.descriptor.fps;
}

/// See the header.
///
/// # Safety
/// `bundle` is NULL or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_faces(bundle: *const SharedBundle) -> *const u32 {
    call(std::ptr::null(), || {
        // SAFETY: the caller's.
        Ok(unsafe { object(bundle, "bundle") }?.0.body.topology.faces.as_flattened().as_ptr())
    })
}

/// See the header.
///
/// # Safety
/// `bundle` is NULL or open; `name` is NULL or has room for `size` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_joint_name(
    bundle: *const SharedBundle,
    joint: usize,
    name: *mut c_char,
    size: usize,
) -> usize {
    call(0, || {
        // SAFETY: the caller's.
        let bundle = unsafe { object(bundle, "bundle") }?;
        let known = bundle.0.body.skeleton.names.get(joint).ok_or_else(|| format!("there is no joint {joint}"))?;
        if !name.is_null() && size > 0 {
            let kept = known.len().min(size - 1);
            // SAFETY: `kept + 1 <= size` bytes, for which the caller has room.
            unsafe {
                std::ptr::copy_nonoverlapping(known.as_ptr().cast(), name, kept);
                name.add(kept).write(0);
            }
        }
        Ok(known.len())
    })
}

/// See the header.
///
/// # Safety
/// `bundle` is NULL or open.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_joint_parent(bundle: *const SharedBundle, joint: usize) -> c_int {
    call(-1, || {
        // SAFETY: the caller's.
        let parents = &unsafe { object(bundle, "bundle") }?.0.body.skeleton.parents;
        let parent = parents.get(joint).ok_or_else(|| format!("there is no joint {joint}"))?;
        Ok(parent.map_or(-1, c_int::from))
    })
}

/// See the header.
///
/// # Safety
/// `bundle` is NULL or open; `shape` has `shape_count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_player_new(
    bundle: *const SharedBundle,
    shape: *const f32,
    shape_count: usize,
) -> *mut OwnPlayer {
    call(std::ptr::null_mut(), || {
        // SAFETY: the caller's.
        let (bundle, shape) = unsafe { (object(bundle, "bundle")?, array(shape, shape_count, "shape")?) };
        let player = Player::new(Arc::clone(&bundle.0), shape).map_err(said)?;
        let rotations = vec![Vec3::ZERO; bundle.0.body.joint_count()];
        Ok(Box::into_raw(Box::new(OwnPlayer { player, controls: Controls::default(), rotations })))
    })
}

/// See the header.
///
/// # Safety
/// `player` is NULL or of `softtissue_player_new`, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_player_free(player: *mut OwnPlayer) {
    if !player.is_null() {
        // SAFETY: it came out of a box, and nobody has it any more.
        let own = unsafe { Box::from_raw(player) };
        call((), || {
            drop(own);
            Ok(())
        });
    }
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living, and used by nobody else.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_reset(player: *mut OwnPlayer) {
    call((), || {
        // SAFETY: the caller's.
        unsafe { own(player, "player") }?.player.reset();
        Ok(())
    });
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living, and used by nobody else; `region` is NULL or a text that ends in zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_control(
    player: *mut OwnPlayer,
    region: *const c_char,
    gain: f32,
    softness: f32,
    damping: f32,
    lag: f32,
) -> c_int {
    call(-1, || {
        // SAFETY: the caller's.
        let (own, name) = unsafe { (own(player, "player")?, text(region, "region")?) };
        let control = Control { gain, softness, damping, lag, ..Control::default() };
        let mut controls = own.controls.clone();
        if name == "everywhere" {
            controls.everywhere = control;
        } else {
            let region =
                region_named(name).map_err(|known| format!("{name:?} is no region; choose everywhere, {known}"))?;
            controls.regions.retain(|(r, _)| *r != region);
            controls.regions.push((region, control));
        }
        own.player.set_controls(&controls).map_err(said)?;
        own.controls = controls;
        Ok(0)
    })
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living, and used by nobody else; `still` is NULL or a text that ends in zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_detail(player: *mut OwnPlayer, components: usize, still: *const c_char) -> c_int {
    call(-1, || {
        // SAFETY: the caller's.
        let own = unsafe { own(player, "player") }?;
        // SAFETY: the caller's.
        let names = if still.is_null() { "" } else { unsafe { text(still, "still") }? };
        let names = names.split(',').map(str::trim).filter(|n| !n.is_empty());
        let still = names.map(|n| region_named(n).map_err(|known| format!("{n:?} is no region; choose {known}")));
        let still = still.collect::<Result<_, _>>()?;
        own.player.set_detail(&Detail { components: (components > 0).then_some(components), still }).map_err(said)?;
        Ok(0)
    })
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living, and used by nobody else.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_fade(player: *mut OwnPlayer, below: f32, patience: f32, seconds: f32) -> c_int {
    call(-1, || {
        // SAFETY: the caller's.
        let player = &mut unsafe { own(player, "player") }?.player;
        player.set_fade(Some(Fade { below, patience, seconds })).map_err(said)?;
        Ok(0)
    })
}

/// The region of a name; all names where there is none.
fn region_named(name: &str) -> Result<Region, String> {
    let region = Region::ALL.into_iter().find(|r| r.name() == name);
    region.ok_or_else(|| Region::ALL.map(Region::name).join(", "))
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living, and used by nobody else; the arrays are NULL or as long as the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_pre_roll(
    player: *mut OwnPlayer,
    rotations: *const f32,
    translation: *const f32,
    seconds: f32,
) -> u32 {
    call(FAILED, || {
        // SAFETY: the caller's.
        let OwnPlayer { player, rotations: pose, .. } = unsafe { own(player, "player") }?;
        // SAFETY: the caller's; the lengths are the header's.
        let pose = unsafe { posed(pose, rotations, translation) }?;
        Ok(bits(&player.pre_roll(pose, seconds)))
    })
}

/// A pose that came as numbers, its rotations copied to `room`.
///
/// # Safety
/// The arrays are NULL or as long as the header says.
unsafe fn posed<'a>(room: &'a mut [Vec3], rotations: *const f32, translation: *const f32) -> Result<Pose<'a>, String> {
    // SAFETY: the caller's.
    let (turned, root) =
        unsafe { (array(rotations, 3 * room.len(), "rotations")?, array(translation, 3, "translation")?) };
    bytemuck::cast_slice_mut(room).copy_from_slice(turned);
    Ok(Pose { rotations: room, translation: Vec3::from_slice(root) })
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living, and used by nobody else; the arrays are NULL or as long as the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_step(
    player: *mut OwnPlayer,
    rotations: *const f32,
    translation: *const f32,
    dt: f32,
    vertices: *mut f32,
) -> u32 {
    call(FAILED, || {
        // SAFETY: the caller's.
        let OwnPlayer { player, rotations: pose, .. } = unsafe { own(player, "player") }?;
        // SAFETY: the caller's; the lengths are the header's.
        let pose = unsafe { posed(pose, rotations, translation) }?;
        let report = if dt == 0.0 { player.step(pose) } else { player.advance(pose, dt) };
        if !vertices.is_null() {
            let posed: &[f32] = bytemuck::cast_slice(player.vertices());
            // SAFETY: not null, and the caller has room for three numbers a vertex.
            unsafe { std::ptr::copy_nonoverlapping(posed.as_ptr(), vertices, posed.len()) };
        }
        Ok(bits(&report))
    })
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living, and used by nobody else; `vertices` is NULL or as long as the header says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_body_alone(player: *mut OwnPlayer, vertices: *mut f32) -> c_int {
    call(-1, || {
        // SAFETY: the caller's.
        let player = &mut unsafe { own(player, "player") }?.player;
        let count = player.bundle().body.vertex_count();
        if vertices.is_null() {
            return Err("vertices is NULL".into());
        }
        // SAFETY: not null, and the caller has room for three numbers a vertex.
        let room = unsafe { std::slice::from_raw_parts_mut(vertices, 3 * count) };
        room.chunks_exact_mut(3).zip(player.body_alone()).for_each(|(to, v)| to.copy_from_slice(&v.to_array()));
        Ok(0)
    })
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_deltas(player: *const OwnPlayer) -> *const f32 {
    call(std::ptr::null(), || {
        // SAFETY: the caller's.
        let deltas: &[f32] = bytemuck::cast_slice(unsafe { object(player, "player") }?.player.deltas());
        Ok(deltas.as_ptr())
    })
}

/// A number of a player; 0 of NULL.
///
/// # Safety
/// `player` is NULL or living.
unsafe fn of_player(player: *const OwnPlayer, what: impl FnOnce(&Player<Arc<Bundle>>) -> f32) -> f32 {
    call(0.0, || {
        // SAFETY: the caller's.
        Ok(what(&unsafe { object(player, "player") }?.player))
    })
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_trust(player: *const OwnPlayer) -> f32 {
    // SAFETY: the caller's.
    unsafe { of_player(player, Player::trust) }
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_latency(player: *const OwnPlayer) -> f32 {
    // SAFETY: the caller's.
    unsafe { of_player(player, Player::latency) }
}

/// See the header.
///
/// # Safety
/// `player` is NULL or living; `count` is NULL or has room for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_features(player: *const OwnPlayer, count: *mut usize) -> *const f32 {
    call(std::ptr::null(), || {
        // SAFETY: the caller's.
        let (player, count) = unsafe { (object(player, "player")?, own(count, "count")?) };
        *count = player.player.features().len();
        Ok(player.player.features().as_ptr())
    })
}

/// See the header.
#[unsafe(no_mangle)]
pub extern "C" fn softtissue_error() -> *const c_char {
    ERROR.with(|error| error.borrow().as_ptr())
}

fn bits(report: &StepReport) -> u32 {
    let told = [
        report.pose_held,
        report.teleported,
        report.features_clipped > 0,
        report.restarted,
        report.time_ignored,
        report.waiting,
    ];
    told.into_iter().enumerate().map(|(i, is)| u32::from(is) << i).sum()
}
