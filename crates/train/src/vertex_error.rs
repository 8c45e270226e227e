use burn::tensor::Tensor;
use glam::Vec3;
use softtissue_model::host;

/// Frames decoded at a time.
const CHUNK: usize = 256;

/// Sum over frames and vertices of the distance in metres that errors of coefficients `[N, K]` make, with
/// `directions [K, V * 3]` in metres for one unit of a coefficient. Both without autodiff.
pub(crate) fn summed_distances(errors: Tensor<2>, directions: &Tensor<2>) -> f64 {
    let frames = errors.dims()[0];
    let mut sum = 0.0;
    for from in (0..frames).step_by(CHUNK) {
        let chunk = errors.clone().slice_dim(0, from..(from + CHUNK).min(frames));
        let offsets = host(chunk.matmul(directions.clone()));
        let (offsets, _) = offsets.as_chunks::<3>();
        sum += offsets.iter().map(|d| f64::from(Vec3::from_array(*d).length())).sum::<f64>();
    }
    sum
}
