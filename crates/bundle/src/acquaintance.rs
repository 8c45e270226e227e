use crate::{Linear, Matrix};

/// How a recurrent network that predicts by itself is mixed with a linear memory that does too: the better it knows the
/// body, the more of it. What a network learns of seven people holds for them; of an eighth it is often wrong, where a
/// linear memory is as right as ever.
///
/// ```text
/// d = min_i |beta - people_i|                                  standard deviations of shape
/// s = share (stranger + (1 - stranger) exp(-d^2))
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Acquaintance {
    /// The network's linear layer around the recurrent unit, `[D + B] -> [L]`.
    pub around: Linear,
    /// Part of the prediction of a body that the network has learned, 0 to 1.
    pub share: f32,
    /// What is left of the share for a body unlike them all, 0 to 1.
    pub stranger: f32,
    /// The people that it has learned, `[P, N]` shape coefficients.
    pub people: Matrix,
}

impl Acquaintance {
    /// `s` of a body. Missing coefficients count as zero, surplus ones are ignored.
    pub fn share_of(&self, beta: &[f32]) -> f32 {
        let distance2 = |person: usize| {
            let theirs = self.people.row(person).iter().enumerate();
            theirs.map(|(i, p)| (p - beta.get(i).copied().unwrap_or(0.0)).powi(2)).sum::<f32>()
        };
        let nearest = (0..self.people.rows()).map(distance2).fold(f32::INFINITY, f32::min);
        self.share * (self.stranger + (1.0 - self.stranger) * (-nearest).exp())
    }

    /// What is wrong with one from a file, for `inputs` and `latents` of its regressor and `shapes` coefficients.
    pub(crate) fn check(&self, inputs: usize, latents: usize, shapes: usize) -> Result<(), String> {
        crate::model::check_linear("around", &self.around, inputs, latents)?;
        crate::model::fits("people", &[self.people.cols()], &[shapes])?;
        let part = |x: f32| (0.0..=1.0).contains(&x);
        match part(self.share) && part(self.stranger) {
            true => Ok(()),
            false => Err(format!(
                "its network's shares are {} and {}, expected 0 to 1; export it again",
                self.share, self.stranger
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_person_it_has_learned_has_the_whole_share_and_a_stranger_what_is_left() {
        let people = Matrix::new(2, 2, vec![1.0, -2.0, 0.0, 1.5]);
        let known = Acquaintance { share: 0.6, stranger: 0.25, people, ..Default::default() };
        for (beta, share) in [
            (&[1.0, -2.0][..], 0.6),
            (&[1.0, -2.0, 7.0], 0.6),
            (&[0.0, 1.5], 0.6),
            (&[1.0, -1.0], 0.6 * (0.25 + 0.75 / std::f32::consts::E)),
            (&[], 0.6 * (0.25 + 0.75 * (-2.25f32).exp())),
            (&[40.0, 0.0], 0.15),
        ] {
            assert!((known.share_of(beta) - share).abs() < 1e-6, "{beta:?}");
        }
        let nobody = Acquaintance { share: 0.6, stranger: 0.25, ..Default::default() };
        assert!((nobody.share_of(&[0.0]) - 0.15).abs() < 1e-6);
    }
}
