//! What is wrong with meshes and sequences: [`Problem`]s with kind, place and count, and those who find them. All of
//! them see one frame at a time, so that no clip need lie in memory whole.

mod exam;
mod likeness;
mod mesh;
mod problem;
mod sides;
mod steps;
mod watch;

pub use exam::{ClipExam, ClipFindings, ExamConfig, Sample};
pub use mesh::{MeshFacts, mesh_problems};
pub use problem::{Place, Problem, ProblemKind};
pub use sides::{SideWatch, Sides, misplaced_joints};
pub use watch::{SequenceWatch, WatchConfig};
