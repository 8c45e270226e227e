use rayon::prelude::*;

/// A linear map from values at `S` places to values at `R` others, at most `width` of the former for each of the latter:
/// `out[r] = sum_w weights[r, w] * values[indices[r, w]]`, with rows that sum to one and no negative weight.
///
/// Rows have a fixed width so that a tensor library needs one selection and one weighted sum.
#[derive(Clone, Debug, PartialEq)]
pub struct Interpolation {
    sources: usize,
    width: usize,
    indices: Vec<u32>,
    weights: Vec<f32>,
}

impl Interpolation {
    /// From rows of (source, weight), padded to the widest with weights of zero. Sources named twice are joined.
    pub fn from_rows(sources: usize, mut rows: Vec<Vec<(u32, f32)>>) -> Self {
        for row in &mut rows {
            row.sort_by_key(|(source, _)| *source);
            row.dedup_by(|next, kept| {
                next.0 == kept.0 && {
                    kept.1 += next.1;
                    true
                }
            });
            row.retain(|(_, weight)| *weight > 0.0);
        }
        let width = rows.iter().map(Vec::len).max().unwrap_or(0);
        let mut out = Self { sources, width, indices: Vec::new(), weights: Vec::new() };
        for row in rows {
            let padding = row.first().map_or(0, |(source, _)| *source);
            out.indices.extend((0..width).map(|w| row.get(w).map_or(padding, |r| r.0)));
            out.weights.extend((0..width).map(|w| row.get(w).map_or(0.0, |r| r.1)));
        }
        out
    }

    /// Places that values are taken from, `S`.
    pub fn sources(&self) -> usize {
        self.sources
    }
    /// Places that get values, `R`.
    pub fn rows(&self) -> usize {
        self.indices.len().checked_div(self.width).unwrap_or(0)
    }
    /// Sources of a row.
    pub fn width(&self) -> usize {
        self.width
    }
    /// `[R, width]` sources.
    pub fn indices(&self) -> &[u32] {
        &self.indices
    }
    /// `[R, width]` weights.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// `[R, channels]` from `[S, channels]`.
    pub fn apply(&self, values: &[f32], channels: usize) -> Vec<f32> {
        assert_eq!(values.len(), self.sources * channels, "values to interpolate");
        let mut out = vec![0.0; self.rows() * channels];
        out.par_chunks_mut(channels.max(1)).with_min_len(1024).enumerate().for_each(|(r, out)| {
            for (source, weight) in self.row(r) {
                let from = &values[source as usize * channels..][..channels];
                out.iter_mut().zip(from).for_each(|(out, x)| *out += weight * x);
            }
        });
        out
    }

    /// The map that does `first` and then this.
    pub fn after(&self, first: &Self) -> Self {
        assert_eq!(self.sources, first.rows(), "values between two interpolations");
        let row = |r: usize| {
            let through = |(source, weight): (u32, f32)| {
                first.row(source as usize).map(move |(from, share)| (from, share * weight))
            };
            self.row(r).flat_map(through).collect()
        };
        Self::from_rows(first.sources, (0..self.rows()).map(row).collect())
    }

    /// Sources and weights of a row, padding among them.
    pub(crate) fn row(&self, r: usize) -> impl Iterator<Item = (u32, f32)> + '_ {
        let range = r * self.width..(r + 1) * self.width;
        self.indices[range.clone()].iter().copied().zip(self.weights[range].iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_join_doubles_and_chain() {
        let a = Interpolation::from_rows(3, vec![vec![(2, 0.25), (0, 0.5), (2, 0.25)], vec![(1, 1.0)]]);
        assert_eq!((a.rows(), a.width(), a.sources()), (2, 2, 3));
        assert_eq!(a.apply(&[1.0, 10.0, 2.0, 20.0, 3.0, 30.0], 2), [2.0, 20.0, 2.0, 20.0]);
        let b = Interpolation::from_rows(2, vec![vec![(0, 0.5), (1, 0.5)]]);
        let both = b.after(&a);
        assert_eq!(both.apply(&[1.0, 2.0, 4.0], 1), b.apply(&a.apply(&[1.0, 2.0, 4.0], 1), 1));
        assert_eq!((both.indices(), both.weights()), (&[0, 1, 2][..], &[0.25, 0.5, 0.25][..]));
    }
}
