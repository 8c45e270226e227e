//! Motions that lift one leg at a time without a flight.
use super::figure::joint;
use super::plan::{Footing, Plant};
use super::posture::{Lift, Posture};
use super::stage::{AHEAD, REST, Stage};
use super::track::smooth;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::PI;

/// Long before and after any clip.
const ALWAYS: f64 = 1e6;

/// High knees, left and right in turn.
pub(crate) struct Knees {
    places: [DVec2; 2],
    start: f64,
    period: f64,
    feet: [Footing; 2],
}

impl Knees {
    pub fn new(stage: &Stage) -> Self {
        let places = stage.places(0.9);
        let (start, period) = (0.5, 1.0 / stage.hertz(1.85));
        let end = stage.stop.unwrap_or(stage.duration);
        let mut plants: [Vec<Plant>; 2] = places.map(|place| vec![Plant { from: -ALWAYS, to: ALWAYS, place }]);
        let mut step = 0;
        while start + period * step as f64 + if stage.stop.is_some() { period } else { 0.0 } < end {
            let side = step % 2;
            let from = start + period * (step as f64 + 0.04);
            let to = from + period * 0.9;
            plants[side].last_mut().expect("starts with one plant").to = from;
            plants[side].push(Plant { from: to, to: ALWAYS, place: places[side] });
            step += 1;
        }
        Self { places, start, period, feet: plants.map(Footing) }
    }

    pub fn places(&self) -> [DVec2; 2] {
        self.places
    }

    pub fn posture(&self, stage: &Stage, t: f64) -> Posture {
        let mut p = stage.easy(self.places, t);
        let turns = (t - self.start) / self.period;
        let active = smooth(turns) * stage.stop.map_or(1.0, |stop| 1.0 - smooth((t - stop + 0.3) / REST));
        // +1 in the middle of a left step, -1 in the middle of a right one
        let beat = active * (PI * turns).sin();
        let mut lifted = [0.0; 2];
        for side in 0..2 {
            let hold = self.feet[side].at(t, 0.42 * self.period);
            let leg = &mut p.legs[side];
            leg.ball = DVec3::new(hold.place.x, 0.03 * hold.airborne, hold.place.y);
            leg.planted = hold.planted;
            leg.lifted = hold.airborne;
            leg.lift = Lift { hip: (1.65 * stage.size_of(side)).min(1.95), out: 0.06, knee: 1.75, foot: 0.3 };
            lifted[side] = hold.airborne;
        }
        for side in 0..2 {
            let swing = if side == 0 { -1.0 } else { 1.0 } * beat;
            let arm = &mut p.arms[side];
            arm.azimuth = AHEAD - 0.25;
            arm.elevation = 0.1 + 0.5 * stage.size_of(side) * swing;
            arm.elbow = stage.style.elbow_carriage + 1.0;
            arm.bend = DVec3::new(-0.15, 0.4, 1.0);
        }
        p.mass.x -= 0.5 * beat * self.places[0].x;
        // some of the lifted leg's rise is taken up by the standing one
        p.mass.y = stage.standing_mass(&stage.easy(self.places, t)).y;
        p.mass_rules.y = 0.3;
        p.pelvis.y -= 0.015 - 0.012 * (lifted[0] + lifted[1]);
        p.turn = DQuat::from_rotation_y(-0.08 * beat) * DQuat::from_rotation_x(-0.06 * (lifted[0] + lifted[1]));
        p.bend_trunk(DVec3::new(0.05, 0.16 * beat, 0.0));
        p
    }
}

/// Standing on one leg, the other shaken loosely.
pub(crate) struct OneLegLoose {
    places: [DVec2; 2],
    standing: usize,
    feet: [Footing; 2],
}

impl OneLegLoose {
    pub fn new(stage: &Stage) -> Self {
        let places = stage.places(0.8);
        let standing = usize::from(!stage.style.left_footed);
        let mut plants = places.map(|place| vec![Plant { from: -ALWAYS, to: ALWAYS, place }]);
        plants[1 - standing][0].to = 0.5;
        if let Some(stop) = stage.stop {
            plants[1 - standing].push(Plant { from: stop + REST, to: ALWAYS, place: places[1 - standing] });
        }
        Self { places, standing, feet: plants.map(Footing) }
    }

    pub fn places(&self) -> [DVec2; 2] {
        self.places
    }

    pub fn posture(&self, stage: &Stage, t: f64) -> Posture {
        let mut p = stage.easy(self.places, t);
        let loose = 1 - self.standing;
        let phase = stage.phase(2.7, t);
        let size = stage.size_of(loose) * stage.envelope(t);
        let hold = self.feet[loose].at(t, 0.4);
        let leg = &mut p.legs[loose];
        leg.ball.y = 0.08 * hold.airborne;
        leg.planted = hold.planted;
        leg.lifted = hold.airborne;
        leg.lift = Lift {
            hip: 0.85 + 0.18 * size * phase.sin(),
            out: 0.15 + 0.08 * size * (0.5 * phase).sin(),
            knee: 1.25 + 0.3 * size * (phase - 1.0).sin(),
            foot: -0.15 + 0.25 * size * (phase - 1.9).sin(),
        };
        let support = stage.support([self.places[self.standing]; 2]);
        p.mass.x = support.x;
        let to_standing = if self.standing == 0 { 1.0 } else { -1.0 };
        p.pelvis.x = 0.9 * stage.figure.joints[joint::HIP[self.standing]].x;
        p.turn = DQuat::from_rotation_z(0.04 * to_standing);
        p.bend_trunk(DVec3::new(0.05, 0.0, -0.1 * to_standing));
        p.pelvis.y -= 0.012;
        for (side, arm) in p.arms.iter_mut().enumerate() {
            arm.elevation += 0.55 + 0.06 * size * (phase - 0.5 - 0.4 * side as f64).sin();
            arm.elbow += 0.2;
        }
        p
    }
}
