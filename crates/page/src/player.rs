/// The player as a WebAssembly module, or the sentence that says how to build with it.
///
/// # Errors
/// This build has none: it was made without the feature `player`.
#[cfg(feature = "player")]
pub fn player_module() -> crate::Result<&'static [u8]> {
    Ok(include_bytes!(concat!(env!("OUT_DIR"), "/player.wasm")))
}

/// The player as a WebAssembly module, or the sentence that says how to build with it.
///
/// # Errors
/// This build has none: it was made without the feature `player`.
#[cfg(not(feature = "player"))]
pub fn player_module() -> crate::Result<&'static [u8]> {
    Err(crate::PageError::NoPlayer)
}
