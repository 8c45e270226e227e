use crate::GradientMap;
use burn::tensor::Tensor;
use softtissue_model::{Gru, GruFrame, host};

/// A rollout of a [`Gru`] with everything that backpropagation through time needs, none of it on an autodiff graph.
///
/// Autodiff forms a full weight gradient at every frame and adds them up. Here only the gradient that reaches each
/// state is carried from frame to frame; everything else, each weight's gradient included, is **one** operation over
/// all `T B` rows.
pub struct GruTrace {
    /// `[T, B, I]`.
    input: Tensor<3>,
    hidden_weight: Tensor<2>,
    /// Gates and states of all frames, `[T B, H]` each.
    all: GruFrame,
}

impl GruTrace {
    /// Rolls `gru` over `input [T, B, I]` from a zero state.
    pub fn new(gru: &Gru, input: Tensor<3>) -> Self {
        let input = input.inner();
        let rollout = gru.rollout(input.clone());
        let mut hidden = Tensor::zeros([input.dims()[1], gru.width()], &input.device());
        let mut frames: Vec<GruFrame> = Vec::with_capacity(rollout.frames());
        for t in 0..rollout.frames() {
            let frame = rollout.frame(t, hidden);
            hidden = frame.hidden.clone();
            frames.push(frame);
        }
        let stacked = |part: fn(&GruFrame) -> &Tensor<2>| {
            Tensor::cat(frames.iter().map(|frame| part(frame).clone()).collect(), 0)
        };
        let all = GruFrame {
            reset: stacked(|f| &f.reset),
            update: stacked(|f| &f.update),
            new: stacked(|f| &f.new),
            recurrent_new: stacked(|f| &f.recurrent_new),
            hidden: stacked(|f| &f.hidden),
        };
        Self { input, hidden_weight: gru.hidden_weight.val().inner(), all }
    }

    /// States after each frame, `[T B, H]`, frame after frame.
    pub fn states(&self) -> Tensor<2> {
        self.all.hidden.clone()
    }

    /// Gradients of the loss with respect to the unit's parameters, by their names in [`Gru`] behind `prefix`, from
    /// its gradient with respect to the states, `[T B, H]`.
    ///
    /// With `dh` the gradient reaching `h_t`, and `'` for the derivative of a gate's argument:
    /// `dn' = dh (1 - z) (1 - n^2)`, `dz' = dh (h_{t-1} - n) z (1 - z)`, `dr' = dn' (h_{t-1} W_hn + b_hn) r (1 - r)`,
    /// and `dh_{t-1} = dh z + [dr', dz', r dn'] W_h^T`. What multiplies `dh` is known for all frames beforehand.
    pub fn backward(&self, states_gradient: Tensor<2>, prefix: &str) -> GradientMap {
        let [frames, batch, inputs] = self.input.dims();
        let [rows, width] = states_gradient.dims();
        assert_eq!((rows, width), (frames * batch, self.hidden_weight.dims()[0]), "gradient of the states");
        let before = self.states_before(batch);
        let GruFrame { reset, update, new, recurrent_new, .. } = self.all.clone();
        let to_new = complement(update.clone()) * complement(new.clone().square());
        let to_update = (before.clone() - new) * update.clone() * complement(update.clone());
        let to_reset = to_new.clone() * recurrent_new * reset.clone() * complement(reset.clone());
        let to_gates = Tensor::stack::<3>(vec![to_reset, to_update, to_new.clone() * reset], 1);

        let weight = self.hidden_weight.clone().transpose();
        let frame = |x: &Tensor<2>, t: usize| x.clone().slice_dim(0, t * batch..(t + 1) * batch);
        let mut carried = Tensor::<2>::zeros([batch, width], &self.input.device());
        let (mut reached, mut at_hidden) = (Vec::with_capacity(frames), Vec::with_capacity(frames));
        for t in (0..frames).rev() {
            let here = frame(&states_gradient, t) + carried;
            let gates = to_gates.clone().slice_dim(0, t * batch..(t + 1) * batch);
            let gates = (gates * here.clone().unsqueeze_dim(1)).reshape([batch, 3 * width]);
            carried = here.clone() * frame(&update, t) + gates.clone().matmul(weight.clone());
            reached.push(here);
            at_hidden.push(gates);
        }
        let in_order = |mut parts: Vec<Tensor<2>>| {
            parts.reverse();
            Tensor::cat(parts, 0)
        };
        let (reached, at_hidden) = (in_order(reached), in_order(at_hidden));
        // The input meets the same gates, but its part of the new state is not scaled by the reset gate.
        let two = at_hidden.clone().slice([0..rows, 0..2 * width]);
        let at_input = Tensor::cat(vec![two, reached * to_new], 1);
        let input = self.input.clone().reshape([rows, inputs]);
        GradientMap::from([
            (format!("{prefix}input_bias"), host(at_input.clone().sum_dim(0))),
            (format!("{prefix}hidden_bias"), host(at_hidden.clone().sum_dim(0))),
            (format!("{prefix}input_weight"), host(input.transpose().matmul(at_input))),
            (format!("{prefix}hidden_weight"), host(before.transpose().matmul(at_hidden))),
        ])
    }

    /// The state that each frame starts from, `[T B, H]`.
    fn states_before(&self, batch: usize) -> Tensor<2> {
        let [rows, width] = self.all.hidden.dims();
        let zero = Tensor::zeros([batch, width], &self.input.device());
        Tensor::cat(vec![zero, self.all.hidden.clone().slice_dim(0, 0..rows - batch)], 0)
    }
}

/// `1 - x`.
fn complement(x: Tensor<2>) -> Tensor<2> {
    x.neg() + 1.0
}
