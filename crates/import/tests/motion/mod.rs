//! Motions of people: the readers against NumPy, one take in several formats, closed forms.

mod formats;
mod mutations;
mod person;
mod refusals;
mod resampling;
mod support;
