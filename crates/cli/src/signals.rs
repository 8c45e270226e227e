//! Ctrl-C and SIGTERM: the first asks to save and stop, the second leaves at once.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// What the handlers set.
#[derive(Clone, Default)]
pub struct Signals {
    stop: Arc<AtomicBool>,
    last: Arc<AtomicUsize>,
}

impl Signals {
    /// Installs the handlers. A second signal exits with 128 + its number.
    pub fn install() -> std::io::Result<Self> {
        let signals = Self::default();
        for signal in [SIGINT, SIGTERM] {
            flag::register_conditional_shutdown(signal, 128 + signal, Arc::clone(&signals.stop))?;
            // Which signal it was stands there before anybody sees that one came.
            flag::register_usize(signal, Arc::clone(&signals.last), signal as usize)?;
            flag::register(signal, Arc::clone(&signals.stop))?;
        }
        Ok(signals)
    }
    /// Whether to stop.
    pub fn should_stop(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
    /// Whether the signal was SIGTERM.
    pub fn terminated(&self) -> bool {
        self.last.load(Ordering::Relaxed) == SIGTERM as usize
    }
}
