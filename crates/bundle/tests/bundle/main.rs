//! `descriptor`: features against closed forms.
//! `player`: the player against sums written out in f64, and against bad input.
//! `reference`: these sums.
//! `tiny`: a small body and a small bundle made from draws.

mod descriptor;
mod player;
mod reference;
mod tiny;
