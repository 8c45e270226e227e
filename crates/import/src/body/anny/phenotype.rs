use softtissue_random::Draws;

/// Somebody in the words of the package: each number from 0 to 1, 0.5 in the middle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phenotype {
    /// 0 male, 1 female.
    pub gender: f32,
    /// 2/3 young, 1 old. Younger people are not read.
    pub age: f32,
    /// Muscle.
    pub muscle: f32,
    /// Weight.
    pub weight: f32,
    /// Stature.
    pub height: f32,
    /// From ideal to uncommon proportions.
    pub proportions: f32,
    /// Size of the breasts.
    pub cup: f32,
    /// Firmness of the breasts.
    pub firmness: f32,
    /// Shares of the African, Asian and Caucasian targets; they sum to one.
    pub ancestry: [f32; 3],
}

/// What a target's name says that it is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// `male` (0), `female` (1).
    Gender(u8),
    /// `young` (0), `old` (1).
    Age(u8),
    /// `minmuscle` to `maxmuscle`, 0 to 2.
    Muscle(u8),
    /// `minweight` to `maxweight`, 0 to 2.
    Weight(u8),
    /// `minheight` (0), `maxheight` (1).
    Height(u8),
    /// `idealproportions` (0), `uncommonproportions` (1).
    Proportions(u8),
    /// `mincup` to `maxcup`, 0 to 2.
    Cup(u8),
    /// `minfirmness` to `maxfirmness`, 0 to 2.
    Firmness(u8),
    /// `african`, `asian`, `caucasian`.
    Ancestry(u8),
    /// `baby`, `child`: not for adults.
    Child,
}

impl Feature {
    /// From a target's name without its ending, words joined by hyphens. `None` where a word is no feature: the target
    /// is another kind of thing.
    pub fn parse_all(name: &str) -> Option<Vec<Self>> {
        name.split('-').filter(|w| *w != "universal").map(Self::parse).collect()
    }

    fn parse(word: &str) -> Option<Self> {
        Some(match word {
            "male" => Self::Gender(0),
            "female" => Self::Gender(1),
            "baby" | "child" => Self::Child,
            "young" => Self::Age(0),
            "old" => Self::Age(1),
            "african" => Self::Ancestry(0),
            "asian" => Self::Ancestry(1),
            "caucasian" => Self::Ancestry(2),
            "minheight" => Self::Height(0),
            "maxheight" => Self::Height(1),
            "idealproportions" => Self::Proportions(0),
            "uncommonproportions" => Self::Proportions(1),
            _ => {
                let at = ["min", "average", "max"].iter().position(|p| word.starts_with(p))?;
                let rest = word.strip_prefix(["min", "average", "max"][at])?;
                match rest {
                    "muscle" => Self::Muscle(at as u8),
                    "weight" => Self::Weight(at as u8),
                    "cup" => Self::Cup(at as u8),
                    "firmness" => Self::Firmness(at as u8),
                    _ => return None,
                }
            }
        })
    }
}

impl Phenotype {
    /// A young adult in the middle of everything.
    pub const NEUTRAL: Self = Self {
        gender: 0.5,
        age: 2.0 / 3.0,
        muscle: 0.5,
        weight: 0.5,
        height: 0.5,
        proportions: 0.5,
        cup: 0.5,
        firmness: 0.5,
        ancestry: [1.0 / 3.0; 3],
    };

    /// How much a feature counts: piecewise linear between the values that targets were made at.
    pub fn weight(&self, feature: Feature) -> f32 {
        let two = |x: f32, at: u8| if at == 0 { 1.0 - x } else { x };
        let three = |x: f32, at: u8| (1.0 - 2.0 * (x - 0.5 * f32::from(at)).abs()).max(0.0);
        match feature {
            Feature::Gender(at) => two(self.gender, at),
            Feature::Age(at) => two(3.0 * self.age - 2.0, at),
            Feature::Muscle(at) => three(self.muscle, at),
            Feature::Weight(at) => three(self.weight, at),
            Feature::Height(at) => two(self.height, at),
            Feature::Proportions(at) => two(self.proportions, at),
            Feature::Cup(at) => three(self.cup, at),
            Feature::Firmness(at) => three(self.firmness, at),
            Feature::Ancestry(at) => self.ancestry[usize::from(at)],
            Feature::Child => 0.0,
        }
    }

    /// Adult number `index` of a seed. Traits are normal about the middle and cut at the ends; weight is even, so that
    /// the light and the heavy are well represented.
    pub fn draw(seed: u64, index: u64) -> Self {
        let mut draws = Draws::new(seed, "import/anny", 0, index);
        let mut near = |middle: f64, deviation: f64| (middle + deviation * draws.normal()).clamp(0.0, 1.0) as f32;
        let (muscle, height, proportions) = (near(0.5, 0.2), near(0.5, 0.15), near(0.5, 0.2));
        let (cup, firmness) = (near(0.5, 0.2), near(0.5, 0.2));
        let shares = [near(0.5, 0.3), near(0.5, 0.3), near(0.5, 0.3)].map(|x| x + 0.05);
        let sum: f32 = shares.iter().sum();
        Self {
            gender: draws.range(0.0, 1.0) as f32,
            age: draws.range(2.0 / 3.0, 0.9) as f32,
            muscle,
            weight: draws.range(0.0, 1.0) as f32,
            height,
            proportions,
            cup,
            firmness,
            ancestry: shares.map(|x| x / sum),
        }
    }
}

/// Stature (m) and volume (l) that the package's own code gives for three people.
#[cfg(test)]
pub fn published() -> [(Phenotype, f32, f64); 3] {
    let male = Phenotype { gender: 0.0, ..Phenotype::NEUTRAL };
    let female = Phenotype { gender: 1.0, ..Phenotype::NEUTRAL };
    [(male, 1.909, 84.83), (female, 1.769, 63.35), (Phenotype { muscle: 0.3, weight: 1.0, ..male }, 1.909, 113.6)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_targets_and_their_weights() {
        let features = Feature::parse_all("universal-female-young-maxmuscle-averageweight").unwrap();
        assert_eq!(features, [Feature::Gender(1), Feature::Age(0), Feature::Muscle(2), Feature::Weight(1)]);
        assert_eq!(Feature::parse_all("nipple-point-incr"), None);
        let p = Phenotype { gender: 1.0, muscle: 0.75, weight: 0.25, ..Phenotype::NEUTRAL };
        let weight: f32 = features.iter().map(|f| p.weight(*f)).product();
        assert!((weight - 0.25).abs() < 1e-6, "{weight}");
        for x in [0.0, 0.3, 0.5, 1.0] {
            let p = Phenotype { muscle: x, ..Phenotype::NEUTRAL };
            let sum: f32 = (0..3).map(|at| p.weight(Feature::Muscle(at))).sum();
            assert!((sum - 1.0).abs() < 1e-6);
        }
    }
}
