use crate::{layer, plain};
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor, activation};
use softtissue_random::Draws;

/// A gated recurrent unit (Cho et al. 2014) with the reset gate applied after the recurrent product and gates in
/// the order reset, update, new, as PyTorch and cuDNN lay them out:
///
/// ```text
/// r  = sigmoid(x W_ir + b_ir + h W_hr + b_hr)
/// z  = sigmoid(x W_iz + b_iz + h W_hz + b_hz)
/// n  = tanh(x W_in + b_in + r (h W_hn + b_hn))
/// h' = (1 - z) n + z h
/// ```
#[derive(Module, Debug)]
pub struct Gru {
    /// `[I, 3 H]`: columns of `W_ir`, then `W_iz`, then `W_in`.
    pub input_weight: Param<Tensor<2>>,
    /// `[H, 3 H]`, likewise.
    pub hidden_weight: Param<Tensor<2>>,
    /// `[3 H]`.
    pub input_bias: Param<Tensor<1>>,
    /// `[3 H]`.
    pub hidden_bias: Param<Tensor<1>>,
}

/// What one frame of a [`Gru`] computes, each `[B, H]`.
#[derive(Clone, Debug)]
pub struct GruFrame {
    /// Reset gate `r`.
    pub reset: Tensor<2>,
    /// Update gate `z`.
    pub update: Tensor<2>,
    /// New state `n`.
    pub new: Tensor<2>,
    /// `h W_hn + b_hn`, what the reset gate multiplies.
    pub recurrent_new: Tensor<2>,
    /// The state after the frame.
    pub hidden: Tensor<2>,
}

/// A [`Gru`]'s weights taken off the autodiff graph and split once for a whole rollout.
#[derive(Clone, Debug)]
pub struct GruRollout {
    hidden_weight: Tensor<2>,
    new_bias: Tensor<2>,
    from_input: Vec<[Tensor<2>; 2]>,
}

impl Gru {
    /// Uniform in `+-1 / sqrt(H)`, PyTorch's default.
    pub fn new(inputs: usize, width: usize, draws: &mut Draws, device: &Device) -> Self {
        let bound = 1.0 / (width as f64).sqrt();
        let mut draw = |n: usize| (0..n).map(|_| draws.range(-bound, bound) as f32).collect();
        Self {
            input_weight: layer::matrix(draw(inputs * 3 * width), [inputs, 3 * width], device),
            hidden_weight: layer::matrix(draw(width * 3 * width), [width, 3 * width], device),
            input_bias: layer::vector(draw(3 * width), device),
            hidden_bias: layer::vector(draw(3 * width), device),
        }
    }

    /// Width of the state, `H`.
    pub fn width(&self) -> usize {
        self.hidden_weight.dims()[0]
    }

    /// Prepares a rollout over `input [T, B, I]`, without autodiff: everything that does not depend on the state is
    /// one product over `T B` rows.
    pub fn rollout(&self, input: Tensor<3>) -> GruRollout {
        let [frames, batch, inputs] = input.dims();
        let width = self.width();
        assert_eq!(inputs, self.input_weight.dims()[0], "inputs of a GRU");
        // The recurrent biases of the reset and update gates are only ever added to the input's.
        let hidden_bias = self.hidden_bias.val().inner();
        let gates =
            self.input_bias.val().inner().slice_dim(0, 0..2 * width) + hidden_bias.clone().slice_dim(0, 0..2 * width);
        let rows = input.inner().reshape([frames * batch, inputs]);
        let weight = self.input_weight.val().inner();
        let product = |columns: std::ops::Range<usize>, bias: Tensor<1>| {
            let columns = weight.clone().slice([0..inputs, columns]);
            rows.clone().matmul(columns) + bias.unsqueeze()
        };
        let gates = product(0..2 * width, gates);
        let new = product(2 * width..3 * width, self.input_bias.val().inner().slice_dim(0, 2 * width..3 * width));
        let frame = |all: &Tensor<2>, t: usize| all.clone().slice_dim(0, t * batch..(t + 1) * batch);
        GruRollout {
            hidden_weight: self.hidden_weight.val().inner(),
            new_bias: hidden_bias.slice_dim(0, 2 * width..3 * width).unsqueeze(),
            from_input: (0..frames).map(|t| [frame(&gates, t), frame(&new, t)]).collect(),
        }
    }

    /// States `[T, B, H]` over `input [T, B, I]` from a zero state, without autodiff.
    pub fn forward(&self, input: Tensor<3>) -> Tensor<3> {
        let rollout = self.rollout(input.clone());
        let mut hidden = Tensor::zeros([input.dims()[1], self.width()], &input.device().inner());
        let mut states = Vec::with_capacity(rollout.frames());
        for t in 0..rollout.frames() {
            hidden = rollout.frame(t, hidden).hidden;
            states.push(hidden.clone());
        }
        Tensor::stack(states, 0)
    }

    /// As plain arrays. Inputs are as the network sees them.
    pub fn to_plain(&self) -> plain::Gru {
        let matrix = |weight: &Param<Tensor<2>>| {
            let [rows, cols] = weight.dims();
            plain::Matrix::new(cols, rows, layer::host(weight.val().inner().transpose()))
        };
        plain::Gru {
            w_ih: matrix(&self.input_weight),
            w_hh: matrix(&self.hidden_weight),
            b_ih: layer::host(self.input_bias.val()),
            b_hh: layer::host(self.hidden_bias.val()),
        }
    }
}

impl GruRollout {
    /// Frames `T`.
    pub fn frames(&self) -> usize {
        self.from_input.len()
    }

    /// Frame `t` from the state before it, `[B, H]`.
    pub fn frame(&self, t: usize, before: Tensor<2>) -> GruFrame {
        let [batch, width] = before.dims();
        let [gates, new] = self.from_input[t].clone();
        let recurrent = before.clone().matmul(self.hidden_weight.clone());
        let columns = |x: &Tensor<2>, from: usize| x.clone().slice([0..batch, from * width..(from + 1) * width]);
        let gates = activation::sigmoid(gates + recurrent.clone().slice([0..batch, 0..2 * width]));
        let (reset, update) = (columns(&gates, 0), columns(&gates, 1));
        let recurrent_new = columns(&recurrent, 2) + self.new_bias.clone();
        let new = (new + reset.clone() * recurrent_new.clone()).tanh();
        let hidden = new.clone() + update.clone() * (before - new.clone());
        GruFrame { reset, update, new, recurrent_new, hidden }
    }
}
