//! The procedural human.
