//! Shape, pose, unposing and delta clips by damped Gauss-Newton.
