//! Integration tests of the customs office.

mod arrays;
mod obj;
