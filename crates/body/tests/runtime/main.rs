//! The body at run time: skinning, its inverse, derivatives and mirroring.

mod derivative;
mod golden;
mod mirror;
mod reference;
mod unposing;
