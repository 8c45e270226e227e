//! Integration tests of the customs office.

mod arrays;
mod motion;
mod obj;
mod scans;
