//! Subspace, descriptor and regressor as trainable modules that turn themselves into a bundle.
