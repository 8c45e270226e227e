//! Integration tests of the training room.

mod train_loop;
