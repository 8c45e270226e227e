//! The procedural human at both levels.
