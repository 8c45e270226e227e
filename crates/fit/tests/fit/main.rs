//! The fit from scans on disk to a fit set.

mod figure;
mod left_out;
mod recovery;
mod refusals;
mod registration;
mod scans;
mod triangles;
