//! Animated glTF and mesh sequences out of a bundle and a motion.
