use crate::layer::{indices, tensor};
use burn::tensor::{Device, Int, Tensor};

/// Rows that are weighted sums of a few rows of another table: how numbers at vertices come into the texels of an atlas
/// and back.
#[derive(Clone, Debug)]
pub struct WeightedRows {
    /// `[N * width]`.
    rows: Tensor<1, Int>,
    /// `[N, width, 1]`.
    weights: Tensor<3>,
}

impl WeightedRows {
    /// `N` rows of `width` summands: `rows [N, width]` and `weights [N, width]`.
    ///
    /// Panics if the two differ in length.
    pub fn new(rows: &[u32], weights: &[f32], width: usize, device: &Device) -> Self {
        assert!(width > 0 && rows.len() == weights.len() && rows.len().is_multiple_of(width), "weighted rows");
        let shape = [rows.len() / width, width, 1];
        Self { rows: indices(rows, device), weights: tensor(weights.to_vec(), shape, device) }
    }

    /// `[M, C] -> [N, C]`.
    pub fn apply(&self, table: Tensor<2>) -> Tensor<2> {
        let [count, width, _] = self.weights.dims();
        let channels = table.dims()[1];
        let summands = table.select(0, self.rows.clone()).reshape([count, width, channels]);
        (summands * self.weights.clone()).sum_dim(1).reshape([count, channels])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_model::host;

    #[test]
    fn rows_are_weighted_sums() {
        let device = Device::flex();
        let rows = WeightedRows::new(&[0, 2, 1, 1], &[0.25, 0.75, 0.0, 2.0], 2, &device);
        let table = tensor(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0], [3, 2], &device);
        assert_eq!(host(rows.apply(table)), [4.0, 5.0, 6.0, 8.0]);
    }
}
