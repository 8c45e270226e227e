use super::figure::{Figure, SIDE, joint::*};
use super::limb::LONGEST_REACH;
use super::posture::{Arm, Leg, Lift, Posture};
use super::solve::{Solved, solve};
use super::style::{Style, Take};
use super::track::smooth;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, TAU};

/// How long the A-pose is held, and when the motion has taken over, seconds.
pub(crate) const A_POSE: f64 = 0.35;
pub(crate) const BLENDED: f64 = 0.9;
/// How long coming to rest takes, seconds.
pub(crate) const REST: f64 = 0.45;

/// Everything a motion needs to know: who, how, which take, when to stop.
pub(crate) struct Stage<'a> {
    pub figure: &'a Figure,
    pub style: &'a Style,
    pub take: &'a Take,
    /// Clip length, seconds.
    pub duration: f64,
    /// When the motion is over and the body stands still; `None` for never.
    pub stop: Option<f64>,
}

impl Stage<'_> {
    /// Frequency of the subject and take, hertz.
    pub fn hertz(&self, base: f64) -> f64 {
        base * self.style.tempo * self.take.tempo
    }
    /// Amplitude of the subject and take.
    pub fn size(&self) -> f64 {
        self.style.amplitude * self.take.amplitude
    }
    /// Amplitude of one side.
    pub fn size_of(&self, side: usize) -> f64 {
        self.size() * (1.0 + SIDE[side] * self.style.asymmetry)
    }
    /// Relative size of cycle `i`.
    pub fn cycle(&self, i: usize) -> f64 {
        1.0 + self.style.variability * self.take.scatter[i % self.take.scatter.len()]
    }
    /// 0 in the A-pose and at rest after the stop, 1 in the motion.
    pub fn envelope(&self, t: f64) -> f64 {
        let rise = smooth((t - A_POSE) / (BLENDED - A_POSE));
        rise * self.stop.map_or(1.0, |stop| 1.0 - smooth((t - stop) / REST))
    }
    /// Phase in radians of a cyclic motion that begins with the blend; its rate scatters slowly.
    pub fn phase(&self, hertz: f64, t: f64) -> f64 {
        let drift = self.style.variability * ((0.7 * t + self.take.phases[0]).sin() - self.take.phases[0].sin());
        TAU * self.hertz(hertz) * (t - A_POSE + drift)
    }
    /// Slow wander number `i`, about one in size, zero where the body must be still.
    pub fn wander(&self, i: usize, t: f64) -> f64 {
        let phase = |k: usize| self.take.phases[(3 * i + k) % self.take.phases.len()];
        let waves =
            (TAU * 0.31 * t + phase(0)).sin() + (TAU * 0.53 * t + phase(1)).sin() + (TAU * 0.83 * t + phase(2)).sin();
        0.8 * waves * self.envelope(t)
    }

    /// Where the balls of the feet stand: `width` times as far apart as people of this build stand, who keep their
    /// feet between the width of the hips and that of the rest pose.
    pub fn places(&self, width: f64) -> [DVec2; 2] {
        std::array::from_fn(|side| {
            let figure = self.figure;
            let foot = figure.joints[BALL[side]] - figure.joints[ANKLE[side]];
            let foot = DQuat::from_rotation_y(SIDE[side] * self.style.toe_out) * foot;
            let x = SIDE[side] * figure.stance_half_width() * width * self.style.stance;
            let ankle_z = 0.5 * (figure.joints[HIP[0]].z + figure.joints[HIP[1]].z);
            DVec2::new(x + 0.5 * foot.x, ankle_z + foot.z)
        })
    }

    /// A leg that stands at `place`.
    pub fn leg(&self, place: DVec2) -> Leg {
        Leg {
            ball: DVec3::new(place.x, 0.0, place.y),
            toe_out: self.style.toe_out,
            heel: 0.0,
            planted: true,
            lift: Lift::default(),
            lifted: 0.0,
        }
    }

    /// Middle of the support: between the feet, from the ankles' line towards the balls.
    pub fn support(&self, places: [DVec2; 2]) -> DVec2 {
        let foot = self.figure.joints[BALL[0]].z - self.figure.joints[ANKLE[0]].z;
        0.5 * (places[0] + places[1]) - DVec2::Y * 0.68 * foot
    }

    /// An arm at ease.
    pub fn easy_arm(&self, side: usize, t: f64) -> Arm {
        let wobble = self.style.wrist_wobble;
        let own = self.style.wrist_offset[side];
        let wrist = DVec3::new(
            own[0] + wobble * self.wander(side, t),
            own[1] + wobble * self.wander(2 + side, t),
            own[2] + wobble * self.wander(4 + side, t),
        );
        Arm {
            collar: DVec3::ZERO,
            elevation: self.style.arm_carriage,
            azimuth: 0.3,
            bend: DVec3::new(-0.2, 0.1, 1.0),
            elbow: self.style.elbow_carriage,
            wrist,
        }
    }

    /// Standing at ease on both feet at `places`, knees almost straight.
    pub fn easy(&self, places: [DVec2; 2], t: f64) -> Posture {
        let figure = self.figure;
        let sway = self.style.sway;
        let support = self.support(places);
        let legs = places.map(|p| self.leg(p));
        let pelvis_height = (0..2)
            .map(|side| {
                let foot = figure.joints[ANKLE[side]] - figure.joints[BALL[side]];
                let ankle = DVec2::new(places[side].x, 0.0)
                    + DVec2::Y * (figure.joints[ANKLE[side]].y - figure.sole)
                    + DVec2::X * (DQuat::from_rotation_y(SIDE[side] * self.style.toe_out) * foot).x;
                let reach = (LONGEST_REACH - 0.007) * figure.leg_length(side);
                let across = ankle.x - SIDE[side] * figure.hip_half_width();
                ankle.y + (reach * reach - across * across).max(0.0).sqrt() + figure.joints[PELVIS].y
                    - figure.joints[HIP[side]].y
            })
            .fold(f64::INFINITY, f64::min);
        let mut posture = Posture {
            pelvis: DVec3::new(support.x, pelvis_height, support.y),
            mass: DVec3::new(support.x, 0.0, support.y),
            mass_rules: DVec3::new(1.0, 0.0, 1.0),
            turn: DQuat::IDENTITY,
            spine: [DVec3::ZERO; 3],
            neck: DVec3::new(-0.5 * self.style.lean, 0.0, 0.0),
            head: DVec3::new(-0.5 * self.style.lean, sway * self.wander(6, t), 0.0),
            arms: std::array::from_fn(|side| self.easy_arm(side, t)),
            legs,
        };
        let tilt = 0.03 * self.style.asymmetry / 0.12;
        posture.bend_trunk(DVec3::new(
            self.style.lean + sway * self.wander(7, t),
            sway * self.wander(5, t),
            tilt + 0.5 * sway * self.wander(1, t),
        ));
        posture
    }

    /// The A-pose: at ease, arms half raised.
    pub fn a_pose(&self, places: [DVec2; 2], t: f64) -> Posture {
        let mut posture = self.easy(places, t);
        for (side, arm) in posture.arms.iter_mut().enumerate() {
            arm.elevation = self.figure.rest_elevation(side).min(0.8);
            arm.azimuth = 0.0;
            arm.elbow = 0.08;
        }
        posture
    }

    /// Solves a posture.
    pub fn solve(&self, posture: &Posture) -> Solved {
        solve(self.figure, posture)
    }

    /// The centre of mass when standing in `posture` by its pelvis height alone.
    pub fn standing_mass(&self, posture: &Posture) -> DVec3 {
        let mut still = posture.clone();
        still.mass_rules.y = 0.0;
        self.solve(&still).mass
    }
}

/// Elevation plane straight ahead.
pub(crate) const AHEAD: f64 = FRAC_PI_2;
