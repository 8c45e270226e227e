use softtissue_random::Draws;

/// The eight physical knobs behind the shape space, each about standard normal over people.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShapeParameters {
    /// Stature, 7 cm a unit.
    pub height: f32,
    /// Body mass at that stature: 15 % of BMI a unit.
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
    /// Scales all knobs towards the neutral body.
    pub fn scaled(self, s: f32) -> Self {
        Self::from_array(self.to_array().map(|x| x * s))
    }
}

/// `count` people: normal draws cut at 2.2 deviations, in antithetic pairs so that the mean stays neutral.
pub fn sample_people(seed: u64, count: usize) -> Vec<ShapeParameters> {
    (0..count)
        .map(|i| {
            let mut draws = Draws::new(seed, "body/people", 0, (i / 2) as u64);
            let sign = if i % 2 == 0 { 1.0 } else { -1.0 };
            ShapeParameters::from_array(std::array::from_fn(|_| {
                let mut x = draws.normal();
                while x.abs() > 2.2 {
                    x = draws.normal();
                }
                (sign * x) as f32
            }))
        })
        .collect()
}
