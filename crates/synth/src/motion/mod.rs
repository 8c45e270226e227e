//! Motions of Dyna's protocol (Pons-Moll et al. 2015), made from code.
//!
//! A motion asks for a posture at every instant: where the feet are, where the centre of mass or the pelvis is,
//! how arms and trunk are held. A solver finds the joints: two-link legs that keep planted feet where they are, a
//! root that puts the centre of mass where the force under the feet drives it. Flights are ballistic and landings
//! reach 2.5-4 body weights, with an impact transient.
//!
//! Every clip begins with an A-pose of 0.35 s; the motion has taken over at 0.9 s.

mod dynamics;
mod figure;
mod hops;
mod limb;
mod perform;
mod plan;
mod planted;
mod posture;
mod solve;
mod stage;
mod steps;
mod style;
mod track;

pub use dynamics::{ground_reaction, landing_peaks};
pub use figure::{Figure, JOINTS};
pub use perform::{MOTIONS, Performance, Request, generate, is_known, perform};
pub use style::Style;
pub use track::GRAVITY;
