//! Moving people made from code: motions, physical flesh and a scanner, with known truth.
