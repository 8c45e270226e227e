//! Physical flesh: explicit finite elements on a shell of prisms, split into tetrahedra, between a smooth bone
//! core and the skin, driven by the skinned body.
//!
//! Displacements `u` are counted from the skinned body, and an element's deformation is `F = I + Du Dm^-1` with
//! `Dm` its **skinned** edge vectors, so that no displacement is at rest in every pose. The unknowns are world
//! velocities; bones, the deepest layer and shallow columns are kinematic and follow Catmull-Rom splines through
//! the frames. Gravity is neutral in the rest pose and turns with the body, so that weightless flight lifts the
//! flesh. One simulation runs on one thread and is a function of its inputs alone.
//!
//! Sources: stable neo-Hookean elasticity (Smith, De Goes and Kim 2018), symplectic Euler with lumped masses
//! (Bonet and Wood 2008, ch. 9), stiffening of fat under stretch (Alkhouli et al. 2013).
//!
//! Not done: contact of flesh with flesh other than the limbs' capsules, anisotropic muscle and its activation,
//! elements that do not lock: linear tetrahedra are too stiff, which the default moduli make up for.

mod assembly;
mod columns;
mod config;
mod contact;
mod elements;
mod folds;
mod interval;
mod kernel;
mod law;
mod number;
mod simulator;
mod state;
mod targets;

#[cfg(test)]
mod barrel;

pub use config::{FleshConfig, FleshLaw, Material};
pub use simulator::{FleshRun, Simulator};
pub use state::Statistics;
