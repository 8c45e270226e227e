//! Integration tests of the customs office.

mod arrays;
mod bodies;
mod motion;
mod obj;
mod scans;
