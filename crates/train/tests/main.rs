//! Integration tests of the training room.

mod neural;
mod train_loop;
