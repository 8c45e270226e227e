use crate::GradientMap;
use burn::tensor::Tensor;
use softtissue_model::{Gru, GruFrame, host};

/// A rollout of a [`Gru`] with everything that backpropagation through time needs, none of it on an autodiff graph.
///
/// Autodiff forms a full weight gradient at every frame and adds them up. Here the frames only carry the gradients
/// of the gates' arguments, and each weight's gradient is **one** product over all `T B` rows.
pub struct GruTrace {
    frames: Vec<GruFrame>,
    input: Tensor<3>,
    hidden_weight: Tensor<2>,
}

impl GruTrace {
    /// Rolls `gru` over `input [T, B, I]` from a zero state.
    pub fn new(gru: &Gru, input: Tensor<3>) -> Self {
        let input = input.inner();
        let rollout = gru.rollout(input.clone());
        let mut hidden = Tensor::zeros([input.dims()[1], gru.width()], &input.device());
        let mut frames = Vec::with_capacity(rollout.frames());
        for t in 0..rollout.frames() {
            let frame = rollout.frame(t, hidden);
            hidden = frame.hidden.clone();
            frames.push(frame);
        }
        Self { frames, input, hidden_weight: gru.hidden_weight.val().inner() }
    }

    /// States after each frame, `[T, B, H]`.
    pub fn states(&self) -> Tensor<3> {
        Tensor::stack(self.frames.iter().map(|f| f.hidden.clone()).collect(), 0)
    }

    /// Gradients of the loss with respect to the unit's parameters, by their names in [`Gru`] behind `prefix`, from
    /// its gradient with respect to the states, `[T, B, H]`.
    ///
    /// With `dh` the gradient reaching `h_t`, and `'` for the derivative of a gate's argument:
    /// `dn' = dh (1 - z) (1 - n^2)`, `dz' = dh (h_{t-1} - n) z (1 - z)`, `dr' = dn' (h W_hn + b_hn) r (1 - r)`,
    /// and `dh_{t-1} = dh z + [dr', dz', r dn'] W_h^T`.
    pub fn backward(&self, states_gradient: Tensor<3>, prefix: &str) -> GradientMap {
        let [count, batch, width] = states_gradient.dims();
        assert_eq!(count, self.frames.len(), "frames of a gradient");
        let zero = Tensor::<2>::zeros([batch, width], &self.input.device());
        let weight = self.hidden_weight.clone().transpose();
        let mut carried = zero.clone();
        let (mut at_input, mut at_hidden) = (Vec::with_capacity(count), Vec::with_capacity(count));
        for t in (0..count).rev() {
            let GruFrame { reset, update, new, recurrent_new, .. } = self.frames[t].clone();
            let before = if t > 0 { self.frames[t - 1].hidden.clone() } else { zero.clone() };
            let reached = states_gradient.clone().slice_dim(0, t..t + 1).reshape([batch, width]) + carried;
            let new_argument = reached.clone() * (update.clone().neg() + 1.0) * (new.clone().square().neg() + 1.0);
            let update_argument = reached.clone() * (before - new) * logistic_slope(update.clone());
            let reset_argument = new_argument.clone() * recurrent_new * logistic_slope(reset.clone());
            let recurrent_argument = new_argument.clone() * reset;
            let hidden_side = Tensor::cat(vec![reset_argument.clone(), update_argument.clone(), recurrent_argument], 1);
            carried = reached * update + hidden_side.clone().matmul(weight.clone());
            at_input.push(Tensor::cat(vec![reset_argument, update_argument, new_argument], 1));
            at_hidden.push(hidden_side);
        }
        at_input.reverse();
        at_hidden.reverse();
        self.weight_gradients(at_input, at_hidden, zero, prefix)
    }

    /// One product for each weight over all frames: `X^T dA`.
    fn weight_gradients(
        &self,
        at_input: Vec<Tensor<2>>,
        at_hidden: Vec<Tensor<2>>,
        zero: Tensor<2>,
        prefix: &str,
    ) -> GradientMap {
        let [frames, batch, inputs] = self.input.dims();
        let states = self.frames[..frames - 1].iter().map(|f| f.hidden.clone());
        let before = Tensor::cat(std::iter::once(zero).chain(states).collect(), 0);
        let input = self.input.clone().reshape([frames * batch, inputs]);
        let (at_input, at_hidden) = (Tensor::cat(at_input, 0), Tensor::cat(at_hidden, 0));
        let named = |name: &str, gradient: Vec<f32>| (format!("{prefix}{name}"), gradient);
        GradientMap::from([
            named("input_bias", host(at_input.clone().sum_dim(0))),
            named("hidden_bias", host(at_hidden.clone().sum_dim(0))),
            named("input_weight", host(input.transpose().matmul(at_input))),
            named("hidden_weight", host(before.transpose().matmul(at_hidden))),
        ])
    }
}

/// The logistic function's slope from its value, `s (1 - s)`.
fn logistic_slope(value: Tensor<2>) -> Tensor<2> {
    value.clone() * (value.neg() + 1.0)
}
