use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Length unit of foreign coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// Metres.
    Metres,
    /// Centimetres.
    Centimetres,
    /// Millimetres.
    Millimetres,
}

impl Units {
    /// Metres in one unit.
    pub fn metres(self) -> f32 {
        match self {
            Self::Metres => 1.0,
            Self::Centimetres => 0.01,
            Self::Millimetres => 0.001,
        }
    }

    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Metres => "metres",
            Self::Centimetres => "centimetres",
            Self::Millimetres => "millimetres",
        }
    }
}

/// Which way is up in foreign coordinates; all are right-handed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// +Y, as here.
    Y,
    /// +Z.
    Z,
    /// +X.
    X,
    /// -Y, as cameras see.
    #[serde(rename = "-y")]
    MinusY,
}

impl UpAxis {
    /// Name as on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Y => "y",
            Self::Z => "z",
            Self::X => "x",
            Self::MinusY => "-y",
        }
    }

    /// A point or direction with Y up. Each is a rotation: no axis is mirrored.
    pub fn y_up(self, p: Vec3) -> Vec3 {
        match self {
            Self::Y => p,
            Self::Z => Vec3::new(p.x, p.z, -p.y),
            Self::X => Vec3::new(-p.y, p.x, p.z),
            Self::MinusY => Vec3::new(p.x, -p.y, -p.z),
        }
    }
}

/// A person's extent upwards, in any pose that a protocol asks for, metres.
const PLAUSIBLE_HEIGHT: std::ops::RangeInclusive<f32> = 0.4..=2.8;

/// Units and up axis of a source, and which of them were guessed.
#[derive(Clone, Debug, PartialEq)]
pub struct Conventions {
    /// Unit of length.
    pub units: Units,
    /// Which way is up.
    pub up: UpAxis,
    /// What was guessed and how to override it, a sentence each.
    pub guessed: Vec<String>,
}

impl Conventions {
    /// What was stated, and for the rest the guess that makes these points a standing person: up is the longer of Y
    /// and Z, the unit the one that makes the height plausible. Where none does, metres stand.
    pub fn of(points: &[Vec3], units: Option<Units>, up: Option<UpAxis>) -> Self {
        let mut guessed = Vec::new();
        let (low, high) = bounds(points);
        let extent = high - low;
        let up = up.unwrap_or_else(|| {
            let up = if extent.z > extent.y { UpAxis::Z } else { UpAxis::Y };
            guessed.push(format!("{} is up, the longer of Y and Z (--up says otherwise)", up.name().to_uppercase()));
            up
        });
        let height = match up {
            UpAxis::Y | UpAxis::MinusY => extent.y,
            UpAxis::Z => extent.z,
            UpAxis::X => extent.x,
        };
        let units = units.unwrap_or_else(|| {
            let plausible = |u: &Units| PLAUSIBLE_HEIGHT.contains(&(height * u.metres()));
            let fitting = [Units::Metres, Units::Centimetres, Units::Millimetres].into_iter().find(plausible);
            let units = fitting.unwrap_or(Units::Metres);
            guessed.push(format!("lengths are {}, for a height of {height:.2} (--units says otherwise)", units.name()));
            units
        });
        Self { units, up, guessed }
    }

    /// A point in metres with Y up.
    pub fn point(&self, p: Vec3) -> Vec3 {
        self.up.y_up(p) * self.units.metres()
    }

    /// Says what is wrong if these points, metres and Y up, cannot be a person.
    pub fn check_height(&self, points: &[Vec3]) -> std::result::Result<(), String> {
        let (low, high) = bounds(points);
        let height = high.y - low.y;
        if PLAUSIBLE_HEIGHT.contains(&height) {
            return Ok(());
        }
        let hint = match height / self.units.metres() {
            h if (40.0..=280.0).contains(&h) => "are its lengths centimetres (--units centimetres)?",
            h if (400.0..=2800.0).contains(&h) => "are its lengths millimetres (--units millimetres)?",
            _ => "check its units (--units) and up axis (--up)",
        };
        Err(format!("the body is {height:.2} m tall: {hint}"))
    }
}

fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    points.iter().fold((Vec3::MAX, Vec3::MIN), |(l, h), p| (l.min(*p), h.max(*p)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn person(up: fn(f32) -> Vec3, size: f32) -> Vec<Vec3> {
        (0..=17).map(|i| up(i as f32 * 0.1 * size) + Vec3::splat(0.01 * size * i as f32)).collect()
    }

    #[test]
    fn units_and_up_axis_are_guessed_and_can_be_stated() {
        for (size, units) in [(1.0, Units::Metres), (100.0, Units::Centimetres), (1000.0, Units::Millimetres)] {
            let found = Conventions::of(&person(|h| Vec3::Z * h, size), None, None);
            assert_eq!((found.units, found.up, found.guessed.len()), (units, UpAxis::Z, 2));
            let turned: Vec<Vec3> = person(|h| Vec3::Z * h, size).into_iter().map(|p| found.point(p)).collect();
            assert_eq!(found.check_height(&turned), Ok(()));
        }
        let stated = Conventions::of(&person(|h| Vec3::Z * h, 100.0), Some(Units::Metres), Some(UpAxis::Y));
        assert_eq!((stated.units, stated.up), (Units::Metres, UpAxis::Y));
        assert!(stated.guessed.is_empty());
        assert!(stated.check_height(&person(|h| Vec3::Y * h, 100.0)).unwrap_err().contains("centimetres"));
    }

    #[test]
    fn turning_up_mirrors_nothing() {
        for (axis, up) in
            [(UpAxis::Y, Vec3::Y), (UpAxis::Z, Vec3::Z), (UpAxis::X, Vec3::X), (UpAxis::MinusY, Vec3::NEG_Y)]
        {
            assert_eq!(axis.y_up(up), Vec3::Y);
            let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|e| axis.y_up(e));
            assert_eq!(x.cross(y), z, "{axis:?}");
        }
    }
}
