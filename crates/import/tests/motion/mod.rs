//! Motions of people: the readers against NumPy, one take in several formats, closed forms.

mod formats;
mod person;
mod refusals;
mod resampling;
mod support;
