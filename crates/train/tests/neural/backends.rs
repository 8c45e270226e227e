use burn::tensor::Device;
use softtissue_train::parity::twenty_steps;

#[test]
fn twenty_steps_repeat_to_the_bit_and_learn() {
    let first = twenty_steps(&Device::flex()).expect("a small training");
    let second = twenty_steps(&Device::flex()).expect("a small training");
    assert_eq!(first, second);
    assert!(first.iter().all(|x| x.is_finite()));
    // The residual branches and the readout start at zero, 800 weights and more; only behind an inner unit that no
    // frame wakes do they stay there.
    let zeros = first.iter().filter(|x| **x == 0.0).count();
    assert!(zeros < 200, "{zeros} of {} numbers never moved", first.len());
}

#[cfg(any(feature = "ndarray", feature = "wgpu"))]
fn agrees_with_flex(name: &str) {
    let device = softtissue_train::device::parse(name).expect("compiled in");
    let wanted = twenty_steps(&Device::flex()).expect("a small training");
    let found = twenty_steps(&device).expect("a small training");
    assert_eq!(found.len(), wanted.len());
    let size = (wanted.iter().map(|x| x * x).sum::<f64>() / wanted.len() as f64).sqrt();
    for (i, (f, w)) in found.iter().zip(&wanted).enumerate() {
        // Losses to 1e-4 of themselves; a weight near zero to 1e-4 of the weights' size.
        assert!((f - w).abs() <= 1e-4 * w.abs().max(0.1 * size.min(1.0)), "number {i}: {f} on {name}, {w} on flex");
    }
}

#[cfg(feature = "ndarray")]
#[test]
fn ndarray_agrees_with_flex() {
    agrees_with_flex("ndarray");
}

#[cfg(feature = "wgpu")]
#[test]
fn wgpu_agrees_with_flex() {
    agrees_with_flex("wgpu");
}
