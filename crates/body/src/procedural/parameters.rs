use softtissue_random::Draws;

/// The eight physical knobs behind the shape space, each about standard normal over people.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeParameters {
    /// Stature, 7 cm a unit.
    pub height: f32,
    /// Body mass at that stature: 17 % of BMI a unit.
    pub mass: f32,
    /// Hips and thighs against waist and chest.
    pub pear: f32,
    /// Breast size.
    pub breast: f32,
    /// Muscle of limbs and shoulders.
    pub muscle: f32,
    /// Shoulder width.
    pub shoulder: f32,
    /// Leg length at fixed stature.
    pub leg: f32,
    /// Belly against the rest of the body.
    pub belly: f32,
}

/// Knobs in [`ShapeParameters`].
pub const PARAMETERS: usize = 8;

/// Relative stature of a unit of the height knob.
pub const STATURE_STEP: f32 = 0.042;
/// Factor on the body mass index of a unit of the mass knob, as the generator's bodies have it (a test measures it).
pub const MASS_STEP: f64 = 1.17;
/// Stature of the neutral figure at level 0, metres (a test measures it).
pub const NEUTRAL_STATURE: f32 = 1.682;
/// Body mass index of the neutral figure at level 0, kg/m^2 (a test measures it).
pub const NEUTRAL_BMI: f64 = 23.06;

impl ShapeParameters {
    /// In declared order.
    pub fn to_array(self) -> [f32; PARAMETERS] {
        [self.height, self.mass, self.pear, self.breast, self.muscle, self.shoulder, self.leg, self.belly]
    }
    /// From declared order.
    pub fn from_array(a: [f32; PARAMETERS]) -> Self {
        Self {
            height: a[0],
            mass: a[1],
            pear: a[2],
            breast: a[3],
            muscle: a[4],
            shoulder: a[5],
            leg: a[6],
            belly: a[7],
        }
    }
    /// Size against the neutral body.
    pub fn scale(self) -> f32 {
        1.0 + STATURE_STEP * self.height
    }
    /// Scales all knobs towards the neutral body.
    pub fn scaled(self, s: f32) -> Self {
        Self::from_array(self.to_array().map(|x| x * s))
    }
}

/// `count` people: normal draws cut at 2.2 deviations, in antithetic pairs so that the mean stays neutral, then made
/// exactly uncorrelated, so that body mass does not come with stature by the luck of the draw.
pub fn sample_people(seed: u64, count: usize) -> Vec<ShapeParameters> {
    let mut columns = vec![vec![0.0f64; count]; PARAMETERS];
    for i in 0..count {
        let mut draws = Draws::new(seed, "body/people", 0, (i / 2) as u64);
        let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
        for column in &mut columns {
            let mut x = draws.normal();
            while x.abs() > 2.2 {
                x = draws.normal();
            }
            column[i] = sign * x;
        }
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    for k in 0..PARAMETERS {
        let (done, rest) = columns.split_at_mut(k);
        let column = &mut rest[0];
        let before = dot(column, column);
        for other in done.iter() {
            let share = dot(column, other) / dot(other, other);
            column.iter_mut().zip(other).for_each(|(x, o)| *x -= share * o);
        }
        let scale = (before / dot(column, column)).sqrt();
        column.iter_mut().for_each(|x| *x *= scale);
    }
    (0..count).map(|i| ShapeParameters::from_array(std::array::from_fn(|k| columns[k][i] as f32))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_are_centred_and_uncorrelated() {
        let people: Vec<[f32; PARAMETERS]> = sample_people(3, 60).into_iter().map(ShapeParameters::to_array).collect();
        let mean = |f: &dyn Fn(&[f32; PARAMETERS]) -> f32| people.iter().map(f).sum::<f32>() / 60.0;
        for i in 0..PARAMETERS {
            assert!(mean(&|p| p[i]).abs() < 1e-5);
            assert!((0.4..1.6).contains(&mean(&|p| p[i] * p[i])));
            assert!((0..i).all(|k| mean(&|p| p[i] * p[k]).abs() < 1e-5));
        }
    }
}
