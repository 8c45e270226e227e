/// Mean over vertices of the squared distance, mm^2, meaned over the batch (SoftSMPL eq. 6, units ours).
///
/// In coefficients of an orthonormal basis a squared distance is the sum of squares over the coefficients, so
/// `error [B, K]` (reconstruction minus target, in units of `scale` metres) is all it takes. Adds the gradient with
/// respect to `error` to `gradient [B, K]` and returns the loss.
pub fn surface_loss(error: &[f32], batch: usize, vertex_count: usize, scale: f32, gradient: &mut [f32]) -> f64 {
    assert_eq!(error.len(), gradient.len(), "gradient of a surface loss");
    let mm = f64::from(scale) * 1000.0;
    let factor = mm * mm / (vertex_count * batch) as f64;
    let slope = (2.0 * factor) as f32;
    gradient.iter_mut().zip(error).for_each(|(g, e)| *g += slope * e);
    factor * error.iter().map(|e| f64::from(*e).powi(2)).sum::<f64>()
}
