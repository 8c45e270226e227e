/// Cosine decay from `start` at step 0 to zero at step `steps` (Loshchilov and Hutter 2017, without restarts), after
/// a linear warm-up over `warm_up` steps.
pub fn cosine(start: f64, step: u64, steps: u64, warm_up: u64) -> f64 {
    let progress = step.min(steps) as f64 / steps.max(1) as f64;
    let warm = if step < warm_up { (step + 1) as f64 / warm_up as f64 } else { 1.0 };
    start * warm * 0.5 * (1.0 + (std::f64::consts::PI * progress).cos())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn falls_from_start_through_half_to_zero() {
        assert_eq!(cosine(3e-3, 0, 100, 0), 3e-3);
        assert!((cosine(3e-3, 50, 100, 0) - 1.5e-3).abs() < 1e-12);
        assert!(cosine(3e-3, 100, 100, 0).abs() < 1e-12);
        assert_eq!(cosine(1.0, 0, 1000, 10), 0.1);
        assert!((0..99).all(|s| cosine(1.0, s, 100, 0) > cosine(1.0, s + 1, 100, 0)));
    }
}
