//! What a web page needs beside the C interface: room in the module's memory for what it hands over.

use std::alloc::{Layout, alloc_zeroed, dealloc};

/// Of what a page hands over, bytes.
const ALIGNMENT: usize = 16;

/// Room for `size` bytes, for a page that has no other way to hand arrays over: it fills them through the module's
/// memory, aligned for numbers. NULL where there is none.
#[unsafe(no_mangle)]
pub extern "C" fn softtissue_allocate(size: usize) -> *mut u8 {
    match Layout::from_size_align(size.max(1), ALIGNMENT) {
        // SAFETY: the size is not zero.
        Ok(layout) => unsafe { alloc_zeroed(layout) },
        Err(_) => std::ptr::null_mut(),
    }
}

/// Gives back what `softtissue_allocate` gave.
///
/// # Safety
/// `pointer` is NULL or of `softtissue_allocate` with this size, and is not used again.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn softtissue_release(pointer: *mut u8, size: usize) {
    if let (false, Ok(layout)) = (pointer.is_null(), Layout::from_size_align(size.max(1), ALIGNMENT)) {
        // SAFETY: the caller's.
        unsafe { dealloc(pointer, layout) };
    }
}
