//! Losses, step, loop, schedule, checkpoint and resume.
