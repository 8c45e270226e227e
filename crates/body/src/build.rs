use crate::{BodyError, BodyModel, Result};
use softtissue_geometry::signed_volume;

/// Mean density of a living body, kg/m^3.
pub const BODY_DENSITY: f64 = 1010.0;

/// How far from the mean the bodies stand that the map is fitted on, in units of `beta`.
const REACH: f32 = 2.0;

/// The cube root of the weight and the height as affine functions of `beta` (Dyna, Pons-Moll et al. 2015, sec. 4.1:
/// weight goes with volume, so that its cube root is the more linear), and from them the body mass index.
///
/// One map for everybody: the shape space does not know of sexes. Least squares over the mean body and those that stand
/// 2 to either side of it along each coefficient; a weight is the rest mesh's volume times [`BODY_DENSITY`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyBuild {
    /// Cube root of the weight, kg^(1/3): constant, then one for each coefficient, `[S + 1]`.
    pub rooted_weight: Vec<f32>,
    /// Height, metres, `[S + 1]`.
    pub height: Vec<f32>,
}

impl BodyBuild {
    /// Fits the map to a body.
    pub fn fit(body: &BodyModel) -> Self {
        let (crown, sole) = extremes(body);
        let measure = |beta: &[f32]| {
            let rest = body.shaped(beta).vertices;
            let volume = signed_volume(&rest, &body.topology.faces).max(0.0);
            ((volume * BODY_DENSITY).cbrt() as f32, rest[crown].y - rest[sole].y)
        };
        let (mut rooted_weight, mut height) = (vec![0.0], vec![0.0]);
        let (mut weights, mut heights) = measure(&[]);
        for s in 0..body.shape_count() {
            let mut beta = vec![0.0; s + 1];
            beta[s] = REACH;
            let above = measure(&beta);
            beta[s] = -REACH;
            let below = measure(&beta);
            rooted_weight.push((above.0 - below.0) / (2.0 * REACH));
            height.push((above.1 - below.1) / (2.0 * REACH));
            weights += above.0 + below.0;
            heights += above.1 + below.1;
        }
        let bodies = (2 * body.shape_count() + 1) as f32;
        (rooted_weight[0], height[0]) = (weights / bodies, heights / bodies);
        Self { rooted_weight, height }
    }

    /// Weight in kilograms. Missing coefficients count as zero, surplus ones are ignored.
    pub fn weight(&self, beta: &[f32]) -> f32 {
        affine(&self.rooted_weight, beta).powi(3)
    }
    /// Height in metres.
    pub fn height(&self, beta: &[f32]) -> f32 {
        affine(&self.height, beta)
    }
    /// Body mass index, kg/m^2.
    pub fn bmi(&self, beta: &[f32]) -> f32 {
        self.weight(beta) / self.height(beta).powi(2)
    }

    /// The shape of somebody of another body mass index and the same height (Dyna eq. 26): `beta + A (f' - f)` with
    /// `f = (weight^(1/3), height)`. `A` is the regression from `f` to `beta` over people whose coefficients have unit
    /// variance, `C^T (C C^T)^-1` for the map `C` of this type, so that the new shape has exactly the index asked for
    /// on this map.
    pub fn at_bmi(&self, beta: &[f32], bmi: f32) -> Result<Vec<f32>> {
        let refuse = |reason: String| Err(BodyError::Inconsistent(reason));
        if !(5.0..=100.0).contains(&bmi) {
            return refuse(format!("nobody has a body mass index of {bmi}; give 5 to 100 kg/m^2"));
        }
        let (weight, height) = (slopes(&self.rooted_weight), slopes(&self.height));
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let (ww, wh, hh) = (dot(&weight, &weight), dot(&weight, &height), dot(&height, &height));
        let determinant = ww * hh - wh * wh;
        if determinant.is_nan() || determinant <= 1e-9 * ww * hh {
            return refuse("its shape space does not vary weight and height apart".into());
        }
        let wanted = (f64::from(bmi) * f64::from(self.height(beta)).powi(2)).cbrt();
        let change = wanted - f64::from(affine(&self.rooted_weight, beta));
        // The change of height is zero, so that the first column of the inverse is all it takes.
        let (u, v) = (hh / determinant * change, -wh / determinant * change);
        let mut out = beta.to_vec();
        out.resize(weight.len(), 0.0);
        for ((b, w), h) in out.iter_mut().zip(&weight).zip(&height) {
            *b += (u * w + v * h) as f32;
        }
        Ok(out)
    }

    /// Whether both rows are finite and of one length.
    pub fn is_sound(&self) -> bool {
        let rows = [&self.rooted_weight, &self.height];
        rows.iter().all(|r| !r.is_empty() && r.len() == rows[0].len() && r.iter().all(|x| x.is_finite()))
    }
}

fn affine(row: &[f32], beta: &[f32]) -> f32 {
    row.first().copied().unwrap_or(0.0) + row.iter().skip(1).zip(beta).map(|(a, b)| a * b).sum::<f32>()
}

fn slopes(row: &[f32]) -> Vec<f64> {
    row.iter().skip(1).map(|x| f64::from(*x)).collect()
}

/// The highest and the lowest vertex of the mean body, which stand for everybody's, so that height is linear.
fn extremes(body: &BodyModel) -> (usize, usize) {
    let highest = |sign: f32| {
        let y = |v: &usize| sign * body.template[*v].y;
        (0..body.vertex_count()).max_by(|a, b| y(a).total_cmp(&y(b))).unwrap_or(0)
    };
    (highest(1.0), highest(-1.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// Weights and heights that are what the map says give its closed forms: 64 kg at 1.6 m is an index of 25.
    #[test]
    fn closed_forms_and_a_new_index_at_the_same_height() {
        let build = BodyBuild { rooted_weight: vec![4.0, 0.1, -0.3, 0.0], height: vec![1.6, 0.06, -0.01, 0.02] };
        assert!(build.is_sound());
        assert!((build.bmi(&[]) - 25.0).abs() < 1e-4);
        assert!((build.weight(&[1.0, -1.0]) - 4.4f32.powi(3)).abs() < 1e-3);
        let beta = [0.4, 0.7, -0.2];
        for bmi in [18.0, 25.0, 40.0] {
            let other = build.at_bmi(&beta, bmi).unwrap();
            assert!((build.bmi(&other) - bmi).abs() < 1e-3, "{bmi}: {}", build.bmi(&other));
            assert!((build.height(&other) - build.height(&beta)).abs() < 1e-5);
        }
        // Least change: what alters neither weight nor height, the normal of both slopes, is left alone.
        let normal = Vec3::new(0.1, -0.3, 0.0).cross(Vec3::new(0.06, -0.01, 0.02));
        let other = build.at_bmi(&beta, 30.0).unwrap();
        assert!(normal.dot(Vec3::from_slice(&other) - Vec3::from(beta)).abs() < 1e-6);
        assert!(build.at_bmi(&beta, f32::NAN).is_err() && build.at_bmi(&beta, 2.0).is_err());
        let flat = BodyBuild { rooted_weight: vec![4.0, 0.1], height: vec![1.6, 0.05] };
        assert!(flat.at_bmi(&[0.0], 25.0).is_err());
    }
}
