use serde::{Deserialize, Serialize};
use softtissue_random::Draws;

/// How one person moves. Drawn once a subject, so that the subject can be read off the pose alone
/// (SoftSMPL sec. 5: the leak that its pose descriptor must take out).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Style {
    /// Multiplies every frequency. Default 1.
    pub tempo: f64,
    /// Multiplies sizes of movement; flight heights too. Default 1.
    pub amplitude: f64,
    /// Multiplies the ground reaction of landings. Default 1.
    pub firmness: f64,
    /// Upper arms' angle from hanging, radians. Default 0.2.
    pub arm_carriage: f64,
    /// Elbows' flexion at ease, radians. Default 0.35.
    pub elbow_carriage: f64,
    /// Forward lean of the trunk, radians. Default 0.03.
    pub lean: f64,
    /// How much more the left side moves than the right, relative. Default 0.
    pub asymmetry: f64,
    /// Resting angle of left and right wrist, axis-angle, radians. Default 0.
    pub wrist_offset: [[f64; 3]; 2],
    /// Amplitude of the wrists' own slow wobble, radians. Default 0.
    pub wrist_wobble: f64,
    /// Toe-out, radians. Default 0.15.
    pub toe_out: f64,
    /// Multiplies the width of the stance. Default 1.
    pub stance: f64,
    /// Relative scatter of repeated cycles. Default 0.
    pub variability: f64,
    /// Slow wander of trunk and head, radians. Default 0.
    pub sway: f64,
    /// Whether one-legged motions stand on the left leg. Default false.
    pub left_footed: bool,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            tempo: 1.0,
            amplitude: 1.0,
            firmness: 1.0,
            arm_carriage: 0.2,
            elbow_carriage: 0.35,
            lean: 0.03,
            asymmetry: 0.0,
            wrist_offset: [[0.0; 3]; 2],
            wrist_wobble: 0.0,
            toe_out: 0.15,
            stance: 1.0,
            variability: 0.0,
            sway: 0.0,
            left_footed: false,
        }
    }
}

impl Style {
    /// Nobody's style: symmetric and without scatter.
    pub fn neutral() -> Self {
        Self::default()
    }

    /// The style of subject number `subject` of a run.
    pub fn draw(seed: u64, subject: u64) -> Self {
        let mut d = Draws::new(seed, "synth-style", subject, 0);
        Self {
            tempo: d.range(0.9, 1.12),
            amplitude: d.range(0.85, 1.15),
            firmness: d.range(0.94, 1.06),
            arm_carriage: d.range(0.1, 0.4),
            elbow_carriage: d.range(0.15, 0.7),
            lean: d.range(-0.02, 0.1),
            asymmetry: d.range(-0.12, 0.12),
            wrist_offset: std::array::from_fn(|_| std::array::from_fn(|_| d.range(-0.22, 0.22))),
            wrist_wobble: d.range(0.02, 0.08),
            toe_out: d.range(0.05, 0.35),
            stance: d.range(0.85, 1.25),
            variability: d.range(0.02, 0.05),
            sway: d.range(0.01, 0.03),
            left_footed: d.uniform() < 0.5,
        }
    }
}

/// What differs between takes of one motion by one person.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Take {
    /// Multiplies the style's tempo.
    pub tempo: f64,
    /// Multiplies the style's amplitude.
    pub amplitude: f64,
    /// Relative scatter of each cycle, drawn beforehand; scaled by the style's variability.
    pub scatter: [f64; 64],
    /// Phases of the slow wander, radians.
    pub phases: [f64; 24],
}

impl Take {
    /// Take 0 keeps the subject's own tempo and amplitude; the others differ by up to 15 and 20 %.
    pub fn draw(seed: u64, subject: &str, motion: &str, take: u32) -> Self {
        let mut d = Draws::new(seed, &format!("synth-take/{subject}/{motion}"), u64::from(take), 0);
        let (tempo, amplitude) = (d.range(0.87, 1.15), d.range(0.8, 1.2));
        Self {
            tempo: if take == 0 { 1.0 } else { tempo },
            amplitude: if take == 0 { 1.0 } else { amplitude },
            scatter: std::array::from_fn(|_| d.range(-1.7, 1.7)),
            phases: std::array::from_fn(|_| d.range(0.0, std::f64::consts::TAU)),
        }
    }
}
