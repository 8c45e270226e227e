//! When the feet leave the ground and come back.
use super::track::{Ends, Force, GRAVITY, Phase, smooth};
use glam::DVec2;

/// Which feet bear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Feet {
    Both,
    /// 0 left, 1 right.
    One(usize),
}

impl Feet {
    pub fn bears(self, side: usize) -> bool {
        match self {
            Self::Both => true,
            Self::One(s) => s == side,
        }
    }
}

/// A flight and the stance after it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hop {
    pub takeoff: f64,
    pub landing: f64,
    /// Feet that land.
    pub feet: Feet,
    /// Where they land: (x, z) of each ball of the foot.
    pub places: [DVec2; 2],
}

/// A time during which a foot bears on the ground.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Plant {
    pub from: f64,
    pub to: f64,
    pub place: DVec2,
}

/// Plants of one foot, in order; the first begins before the clip.
#[derive(Clone, Debug)]
pub(crate) struct Footing(pub Vec<Plant>);

/// Where a foot is at an instant.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Foothold {
    pub place: DVec2,
    pub planted: bool,
    /// 0 on the ground, 1 in the middle of a swing.
    pub airborne: f64,
    /// Length of the swing, seconds.
    pub swing: f64,
}

impl Footing {
    /// Where the foot is at `t`. A swing leaves and meets the ground within `ramp` seconds or 45 % of its length.
    pub fn at(&self, t: f64, ramp: f64) -> Foothold {
        let next = self.0.iter().position(|p| t < p.from).unwrap_or(self.0.len());
        let Some(last) = next.checked_sub(1).map(|i| self.0[i]) else {
            return Foothold { place: self.0[0].place, planted: true, airborne: 0.0, swing: 0.0 };
        };
        if t <= last.to {
            return Foothold { place: last.place, planted: true, airborne: 0.0, swing: 0.0 };
        }
        let Some(next) = self.0.get(next) else {
            return Foothold {
                place: last.place,
                planted: false,
                airborne: smooth((t - last.to) / ramp),
                swing: f64::INFINITY,
            };
        };
        let swing = next.from - last.to;
        let ramp = ramp.min(0.45 * swing);
        Foothold {
            place: last.place.lerp(next.place, smooth((t - last.to) / swing)),
            planted: false,
            airborne: smooth((t - last.to) / ramp) * smooth((next.from - t) / ramp),
            swing,
        }
    }
}

/// Heights of the centre of mass over standing at take-off and landing of each hop, metres.
pub(crate) type Contacts = Vec<[f64; 2]>;

/// The whole clip's vertical movement: standing, hops, standing.
#[derive(Clone, Debug)]
pub(crate) struct Course {
    phases: Vec<Phase>,
}

impl Course {
    /// `push_off`: when the dip for the first take-off begins. `settle`: the force peak of the last landing if the
    /// body comes to rest after it; otherwise the last flight is the end.
    pub fn new(push_off: f64, hops: &[Hop], contacts: &Contacts, settle: Option<f64>) -> Self {
        assert_eq!(hops.len(), contacts.len(), "contacts of a plan");
        let mut phases = Vec::new();
        let (mut time, mut speed, mut height) = (push_off, 0.0, 0.0);
        for (i, (hop, contact)) in hops.iter().zip(contacts).enumerate() {
            let flight = hop.landing - hop.takeoff;
            let leave = (contact[1] - contact[0]) / flight + 0.5 * GRAVITY * flight;
            let force = if i == 0 { Force::PushOff } else { Force::Bounce };
            let ends = Ends { speed: [speed, leave], height: [height, contact[0]] };
            phases.push(Phase::new(force, time, hop.takeoff - time, ends));
            let arrive = leave - GRAVITY * flight;
            let ends = Ends { speed: [leave, arrive], height: *contact };
            phases.push(Phase::new(Force::Flight, hop.takeoff, flight, ends));
            (time, speed, height) = (hop.landing, arrive, contact[1]);
        }
        if let Some(peak) = settle {
            let ends = Ends { speed: [speed, 0.0], height: [height, 0.0] };
            let duration = Phase::duration_for_peak(Force::Settle, ends, peak);
            phases.push(Phase::new(Force::Settle, time, duration, ends));
        }
        Self { phases }
    }

    /// When the last phase ends, seconds.
    pub fn end(&self) -> f64 {
        self.phases.last().map_or(0.0, |p| p.start + p.duration)
    }

    /// Height of the centre of mass over standing.
    pub fn height(&self, t: f64) -> f64 {
        match self.phases.iter().find(|p| p.ends_after(t)).or(self.phases.last()) {
            Some(phase) => phase.height(t.max(phase.start)),
            None => 0.0,
        }
    }
}
