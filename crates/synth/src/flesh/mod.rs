//! Physical flesh by explicit finite elements.
