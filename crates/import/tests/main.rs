//! Integration tests of the customs office.

mod obj;
