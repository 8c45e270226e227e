use crate::Matrix;

/// A fully connected layer, `y = W x + b`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Linear {
    /// `W [out, in]`.
    pub weight: Matrix,
    /// `b [out]`.
    pub bias: Vec<f32>,
}

/// Linear, rectified, linear: half of the autoencoder of Casas and Otaduy (2018 sec. 3.3).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ThreeLayers(pub [Linear; 3]);

/// A gated recurrent unit (Cho et al. 2014) with the reset gate applied after the recurrent product and gates in
/// the order reset, update, new, as PyTorch and cuDNN lay them out:
///
/// ```text
/// r  = sigmoid(W_ir x + b_ir + W_hr h + b_hr)
/// z  = sigmoid(W_iz x + b_iz + W_hz h + b_hz)
/// n  = tanh(W_in x + b_in + r * (W_hn h + b_hn))
/// h' = (1 - z) n + z h
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gru {
    /// `[3H, I]`: rows of `W_ir`, then `W_iz`, then `W_in`.
    pub w_ih: Matrix,
    /// `[3H, H]`: rows of `W_hr`, then `W_hz`, then `W_hn`.
    pub w_hh: Matrix,
    /// `[3H]`.
    pub b_ih: Vec<f32>,
    /// `[3H]`.
    pub b_hh: Vec<f32>,
}

/// A pre-activation residual unit (He et al. 2016), `x + B relu(A relu(x) + a) + b`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ResidualUnit {
    /// `A [W, K]` and its bias `a [W]`.
    pub inner: Linear,
    /// `B [K, W]` and its bias `b [K]`.
    pub outer: Linear,
}

impl Linear {
    /// Inputs.
    pub fn inputs(&self) -> usize {
        self.weight.cols()
    }
    /// Outputs.
    pub fn outputs(&self) -> usize {
        self.weight.rows()
    }
    /// `y = W x + b`; `x [in]`, `y [out]`.
    pub fn apply(&self, x: &[f32], y: &mut [f32]) {
        self.weight.times(x, y);
        y.iter_mut().zip(&self.bias).for_each(|(y, b)| *y += b);
    }
}

impl ThreeLayers {
    /// Inputs.
    pub fn inputs(&self) -> usize {
        self.0[0].inputs()
    }
    /// Outputs.
    pub fn outputs(&self) -> usize {
        self.0[2].outputs()
    }
    /// Working memory that fits.
    pub fn scratch(&self) -> [Vec<f32>; 2] {
        [vec![0.0; self.0[0].outputs()], vec![0.0; self.0[1].outputs()]]
    }
    /// `x [inputs]` to `y [outputs]`; `scratch` is overwritten.
    pub fn apply(&self, x: &[f32], [a, b]: &mut [Vec<f32>; 2], y: &mut [f32]) {
        let [first, second, third] = &self.0;
        first.apply(x, a);
        second.apply(a, b);
        b.iter_mut().for_each(|b| *b = b.max(0.0));
        third.apply(b, y);
    }
}

impl Gru {
    /// Width of the state, `H`.
    pub fn width(&self) -> usize {
        self.w_hh.cols()
    }
    /// Inputs, `I`.
    pub fn inputs(&self) -> usize {
        self.w_ih.cols()
    }
    /// One step: `x [I]`; `h [H]` becomes the new state; `scratch [6H]` is overwritten.
    pub fn step(&self, x: &[f32], h: &mut [f32], scratch: &mut [f32]) {
        let width = self.width();
        let (from_input, from_state) = scratch.split_at_mut(3 * width);
        self.w_ih.times(x, from_input);
        self.w_hh.times(h, from_state);
        for i in 0..width {
            let [r, z, n] = [i, width + i, 2 * width + i];
            let reset = sigmoid(from_input[r] + self.b_ih[r] + from_state[r] + self.b_hh[r]);
            let update = sigmoid(from_input[z] + self.b_ih[z] + from_state[z] + self.b_hh[z]);
            let new = (from_input[n] + self.b_ih[n] + reset * (from_state[n] + self.b_hh[n])).tanh();
            h[i] = (1.0 - update) * new + update * h[i];
        }
    }
}

impl ResidualUnit {
    /// Inputs and outputs, `K`.
    pub fn width(&self) -> usize {
        self.outer.outputs()
    }
    /// Inner width, `W`.
    pub fn inner_width(&self) -> usize {
        self.inner.outputs()
    }
    /// `x [K]` in place; `scratch` holds at least `2 K + W` numbers and is overwritten.
    pub fn apply(&self, x: &mut [f32], scratch: &mut [f32]) {
        let (k, w) = (self.width(), self.inner_width());
        let (rectified, rest) = scratch.split_at_mut(k);
        let (inner, rest) = rest.split_at_mut(w);
        let branch = &mut rest[..k];
        rectified.iter_mut().zip(&*x).for_each(|(r, x)| *r = x.max(0.0));
        self.inner.apply(rectified, inner);
        inner.iter_mut().for_each(|y| *y = y.max(0.0));
        self.outer.apply(inner, branch);
        x.iter_mut().zip(branch).for_each(|(x, b)| *x += *b);
    }
}

fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}
