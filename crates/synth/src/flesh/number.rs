use std::ops::{Add, Div, Mul, Neg, Sub};

/// Elements worked on side by side.
pub const LANES: usize = 4;

/// What the element formulas are written in: [`Lanes`] in the simulator, `f64` in the tests of their gradients.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The same value in every lane.
    fn splat(x: f32) -> Self;
    /// Smaller of two.
    fn min(self, other: Self) -> Self;
    /// Larger of two.
    fn max(self, other: Self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
}

/// Four numbers treated alike; the loops over the array become vector instructions.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(16))]
pub struct Lanes(pub [f32; LANES]);

macro_rules! lanewise {
    ($trait:ident, $method:ident, $op:tt) => {
        impl $trait for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                let mut out = [0.0; LANES];
                for i in 0..LANES {
                    out[i] = self.0[i] $op other.0[i];
                }
                Self(out)
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|x| -x))
    }
}

impl Lanes {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = f(self.0[i], other.0[i]);
        }
        Self(out)
    }
}

impl Number for Lanes {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; LANES])
    }
    // The comparisons are written out: f32::min keeps NaN rules that cost instructions.
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, |a, b| if a < b { a } else { b })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.zip(other, |a, b| if a > b { a } else { b })
    }
    #[inline(always)]
    fn ln(self) -> Self {
        Self(self.0.map(f32::ln))
    }
}

impl Number for f64 {
    fn splat(x: f32) -> Self {
        f64::from(x)
    }
    fn min(self, other: Self) -> Self {
        f64::min(self, other)
    }
    fn max(self, other: Self) -> Self {
        f64::max(self, other)
    }
    fn ln(self) -> Self {
        f64::ln(self)
    }
}

/// A 3 x 3 matrix, `m[row][column]`.
pub type Matrix<N> = [[N; 3]; 3];

#[inline(always)]
pub fn generate<N: Number>(f: impl Fn(usize, usize) -> N) -> Matrix<N> {
    [[f(0, 0), f(0, 1), f(0, 2)], [f(1, 0), f(1, 1), f(1, 2)], [f(2, 0), f(2, 1), f(2, 2)]]
}

/// `a b`.
#[inline(always)]
pub fn multiply<N: Number>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    generate(|i, j| a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j])
}

/// `a^T b`.
#[inline(always)]
pub fn transpose_multiply<N: Number>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    generate(|i, j| a[0][i] * b[0][j] + a[1][i] * b[1][j] + a[2][i] * b[2][j])
}

/// `a b^T`.
#[inline(always)]
pub fn multiply_transpose<N: Number>(a: &Matrix<N>, b: &Matrix<N>) -> Matrix<N> {
    generate(|i, j| a[i][0] * b[j][0] + a[i][1] * b[j][1] + a[i][2] * b[j][2])
}

/// Cofactors: `m^-1 = cof^T / det`.
#[inline(always)]
pub fn cofactors<N: Number>(m: &Matrix<N>) -> Matrix<N> {
    generate(|i, j| {
        let (r, s) = ((i + 1) % 3, (i + 2) % 3);
        let (c, d) = ((j + 1) % 3, (j + 2) % 3);
        m[r][c] * m[s][d] - m[r][d] * m[s][c]
    })
}

/// Determinant from a matrix and its cofactors.
#[inline(always)]
pub fn determinant<N: Number>(m: &Matrix<N>, cofactors: &Matrix<N>) -> N {
    m[0][0] * cofactors[0][0] + m[0][1] * cofactors[0][1] + m[0][2] * cofactors[0][2]
}
