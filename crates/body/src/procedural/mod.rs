//! The procedural human: a parametric body from code alone, with nothing to download.
//!
//! ```no_run
//! # fn main() -> softtissue_body::Result<()> {
//! use softtissue_body::procedural::{ProceduralConfig, generate};
//! let body = generate(&ProceduralConfig { level: 0, ..Default::default() })?;
//! let beta = body.anatomy.beta_for_bmi(28.0, &[])?;
//! let shaped = body.model.shaped(&beta);
//! let bones = body.anatomy.bones(&beta, &shaped.joints); // smooth bone distance and gradient
//! let fat = body.anatomy.fat_thickness(&beta); // metres, one a vertex
//! # Ok(()) }
//! ```
//!
//! Conventions: metres, Y up, facing +Z, left is +X; rest pose is an A-pose with the soles at `y = 0`, 24 joints in
//! SMPL's order. `beta` has unit variance a coefficient; `beta[0]` is stature (positive = taller) and `beta[1]` body
//! mass (**negative = heavier**). [`generate_levels`] gives both levels, which share `beta`, and the
//! [`SubdivisionMap`] that lifts a field on level 0 (`V` vertices) to level 1 (`4V - 6`).
//!
//! How it is made: an implicit figure of lofts, cones and ellipsoids steered by eight knobs ([`ShapeParameters`]);
//! surface nets on a mirror-symmetric grid; the same topology carried to every sampled person by homotopy,
//! projection and tangential relaxation; principal components over the people. From there on nothing knows where the
//! people came from: [`SampledPeople`] makes a body of anybody's, and [`Anatomy::of`] puts flesh under any body of
//! these joints.

mod anatomy;
mod assembly;
mod atlas;
mod bones;
mod chart;
mod figure;
mod generator;
mod implicit;
mod joint_rows;
mod parameters;
mod parts;
mod pose_fit;
mod relax;
mod sampled;
mod shape_space;
mod skeleton;
mod subdivision;
mod surface_nets;
mod weights;

pub use anatomy::Anatomy;
pub use bones::{BoneCapsule, BoneField};
pub use generator::{Levels, ProceduralBody, ProceduralConfig, generate, generate_levels};
pub use parameters::ShapeParameters;
pub use sampled::{SampledPeople, SampledPerson, derived_regions};
pub use subdivision::SubdivisionMap;
