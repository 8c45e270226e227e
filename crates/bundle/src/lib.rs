//! The shipped model format and the player that runs it without a machine-learning framework.
