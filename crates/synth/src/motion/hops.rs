//! Motions with flights: hops on both feet or one, jumping jacks, running on the spot.
use super::plan::{Contacts, Course, Feet, Footing, Hop, Plant};
use super::posture::{Lift, Posture};
use super::stage::{AHEAD, REST, Stage};
use super::track::{Ends, Force, GRAVITY, Phase, smooth};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::PI;

/// When the dip for the first take-off begins at the earliest, seconds.
const DIP: f64 = 0.55;
/// From there to the take-off, seconds: less would ask for a harder push than the landings.
const PUSH_OFF: f64 = 0.42;
/// Long before and after any clip.
const ALWAYS: f64 = 1e6;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Pattern {
    Loose,
    Stiff,
    Jacks,
    OneLeg,
    Running,
}

/// What distinguishes the hopping motions.
#[derive(Clone, Copy, Debug)]
struct Kind {
    pattern: Pattern,
    /// Flight of the nominal subject, seconds.
    flight: f64,
    /// Ground reaction at the peak of a landing, body weights.
    peak: f64,
    /// Stance width in hip widths.
    width: f64,
    /// Heel raise at take-off and landing, and at the bottom of the stance, radians.
    heel: [f64; 2],
    /// Exactly so many hops, the last landing as late as the clip allows: the flesh still rings when the body stands.
    /// Their flights do not follow a subject's style.
    hops: Option<usize>,
}

fn kind(name: &str) -> Option<Kind> {
    let kind = |pattern, flight, peak, width, heel, hops| Some(Kind { pattern, flight, peak, width, heel, hops });
    match name {
        "light_hopping_loose" => kind(Pattern::Loose, 0.21, 2.95, 1.0, [0.42, 0.0], None),
        "light_hopping_stiff" => kind(Pattern::Stiff, 0.19, 3.2, 0.85, [0.38, 0.18], None),
        "jumping_jacks" => kind(Pattern::Jacks, 0.28, 3.25, 0.8, [0.42, 0.05], None),
        "one_leg_jump" => kind(Pattern::OneLeg, 0.22, 3.1, 0.8, [0.38, 0.0], None),
        "running_on_spot" => kind(Pattern::Running, 0.13, 2.9, 0.8, [0.33, 0.0], None),
        "hop" => kind(Pattern::Loose, 0.24, 3.5, 1.0, [0.2, 0.0], Some(2)),
        _ => None,
    }
}

/// A hopping motion of one subject and take, planned through the clip.
pub(crate) struct Hopping {
    kind: Kind,
    hops: Vec<Hop>,
    feet: [Footing; 2],
    places: [DVec2; 2],
    course: Course,
    /// Centre of mass when standing at ease.
    mass: DVec3,
    /// The last landing, if the body stands still after it.
    stop: Option<f64>,
    push_off: f64,
}

impl Hopping {
    /// `None` if `name` is no hopping motion.
    pub fn new(name: &str, stage: &Stage) -> Option<Self> {
        let kind = kind(name)?;
        let hopping = Self::from(kind, stage, DIP);
        let late = stage.stop.filter(|_| kind.hops.is_some()).map_or(0.0, |stop| stop + REST - hopping.course.end());
        Some(if late > 0.0 { Self::from(kind, stage, DIP + late) } else { hopping })
    }

    /// The dip for the first take-off begins at `push_off`.
    fn from(kind: Kind, stage: &Stage, push_off: f64) -> Self {
        let places = stage.places(kind.width);
        let peak = (kind.peak * stage.style.firmness).clamp(2.75, 3.6);
        let (hops, finished) = plan(&kind, stage, places, peak, push_off);
        let feet = footings(&kind, &hops, places, finished);
        let stop = if finished { hops.last().map(|h| h.landing) } else { None };
        let course = Course::new(push_off, &[], &vec![], None);
        let mut hopping = Self { kind, hops, feet, places, course, mass: DVec3::ZERO, stop, push_off };
        let standing = hopping.limbs(stage, hopping.push_off);
        hopping.mass = stage.standing_mass(&standing);
        let contacts = hopping.contacts(stage);
        hopping.course = Course::new(push_off, &hopping.hops, &contacts, finished.then_some(peak));
        hopping
    }

    pub fn places(&self) -> [DVec2; 2] {
        self.places
    }

    /// 0 in the A-pose and at rest, 1 between. Who hops a counted number of times stands as the last landing ends:
    /// arms that go back would move the flesh on.
    pub fn envelope(&self, t: f64) -> f64 {
        let back = self.stop.filter(|_| self.kind.hops.is_none());
        smooth((t - 0.35) / 0.45) * back.map_or(1.0, |stop| 1.0 - smooth((t - stop - 0.12) / 0.5))
    }

    pub fn posture(&self, stage: &Stage, t: f64) -> Posture {
        let mut p = self.limbs(stage, t);
        p.mass.y = self.mass.y + self.course.height(t);
        p
    }

    /// Heights over standing at which the legs, stretched and on the balls of the feet, leave and meet the ground.
    fn contacts(&self, stage: &Stage) -> Contacts {
        let highest = |t: f64| {
            let mut p = self.limbs(stage, t);
            let [mut low, mut high] = [-0.15, 0.25];
            for _ in 0..24 {
                let middle = 0.5 * (low + high);
                p.mass.y = self.mass.y + middle;
                let solved = stage.solve(&p);
                let stretched = (0..2).any(|s| p.legs[s].planted && solved.heel[s] > self.kind.heel[0] + 0.08);
                if stretched { high = middle } else { low = middle }
            }
            low
        };
        let reach: Contacts = self.hops.iter().map(|h| [highest(h.takeoff), highest(h.landing)]).collect();
        // where the arms are raised the mass is higher; half of that goes into bent legs
        let least = reach.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        reach.iter().map(|r| r.map(|h| 0.5 * (h + least))).collect()
    }

    /// Everything but the height of the centre of mass.
    fn limbs(&self, stage: &Stage, t: f64) -> Posture {
        let mut p = stage.easy(self.places, t);
        let beat = self.beats(t);
        self.place_legs(stage, &mut p, t, beat);
        self.place_mass(stage, &mut p, beat);
        let dip = (2.0 * PI * beat).cos();
        let size = stage.size() * self.envelope(t);
        for side in 0..2 {
            self.swing_arm(stage, &mut p, side, beat, size);
        }
        match self.kind.pattern {
            Pattern::Running => {
                let step = self.envelope(t) * (PI * beat).sin();
                let step = step * if self.first_side() == 0 { 1.0 } else { -1.0 };
                p.turn = DQuat::from_rotation_y(0.07 * step);
                p.bend_trunk(DVec3::new(0.06, -0.2 * step, 0.0));
            }
            Pattern::Stiff => p.bend_trunk(DVec3::X * 0.02 * size * dip),
            _ => p.bend_trunk(DVec3::X * (0.05 + 0.06 * size * dip)),
        }
        p.mass_rules = DVec3::ONE;
        p
    }

    fn place_legs(&self, stage: &Stage, p: &mut Posture, t: f64, beat: f64) {
        let bounce = (2.0 * PI * beat - 0.8).cos();
        for side in 0..2 {
            let running = self.kind.pattern == Pattern::Running;
            let hold = self.feet[side].at(t, if running { 0.2 } else { 0.3 });
            let held = self.kind.pattern == Pattern::OneLeg && side != self.standing(stage);
            let (lift, lifted, clearance) = match self.kind.pattern {
                Pattern::Running => {
                    let hip = (0.7 * stage.size_of(side)).min(1.1);
                    // a short swing leaves no time for a high foot
                    (Lift { hip, out: 0.04, knee: 1.55, foot: 0.45 }, 0.92 * (hold.swing / 0.4).min(1.0).powi(2), 0.06)
                }
                _ if held => {
                    (Lift { hip: 0.4 + 0.1 * bounce, out: 0.07, knee: 1.5 + 0.12 * bounce, foot: -0.15 }, 1.0, 0.03)
                }
                Pattern::Stiff => (Lift { hip: 0.05, out: 0.0, knee: 0.1, foot: 0.6 }, 0.2, 0.06),
                _ => (Lift { hip: 0.3, out: 0.02, knee: 0.65, foot: 0.6 }, 0.3, 0.06),
            };
            let leg = &mut p.legs[side];
            leg.ball = DVec3::new(hold.place.x, clearance * hold.airborne, hold.place.y);
            leg.planted = hold.planted;
            leg.lift = lift;
            leg.lifted = lifted * hold.airborne;
            leg.heel = self.heel(t);
        }
    }

    /// Least heel raise: high at contacts, low at the bottom of the stance, none when standing.
    fn heel(&self, t: f64) -> f64 {
        let [contact, bottom] = self.kind.heel;
        let away = self.hops.iter().flat_map(|h| [h.takeoff, h.landing]).map(|e| (e - t).abs()).fold(ALWAYS, f64::min);
        let flying = self.hops.iter().any(|h| h.takeoff < t && t < h.landing);
        let first = self.hops.first().map_or(ALWAYS, |h| h.takeoff);
        let still = t < first - 0.1 || self.stop.is_some_and(|s| t > s + 0.1);
        let low = if still { 0.0 } else { bottom };
        if flying { contact } else { low + (contact - low) * (1.0 - smooth(away / 0.1)) }
    }

    fn place_mass(&self, stage: &Stage, p: &mut Posture, beat: f64) {
        let i = beat.floor().max(0.0) as usize;
        let s = 0.5 - 0.5 * (PI * (beat - i as f64).clamp(0.0, 1.0)).cos();
        let place = self.support(stage, i).lerp(self.support(stage, i + 1), s);
        (p.mass.x, p.mass.z) = (place.x, place.y);
        (p.pelvis.x, p.pelvis.z) = (place.x, place.y);
    }

    /// Where the mass belongs over stance `i` (0: before the first hop).
    fn support(&self, stage: &Stage, i: usize) -> DVec2 {
        let hop = match i {
            0 => None,
            _ => self.hops.get(i - 1).or(self.hops.last()),
        };
        let (feet, places) = hop.map_or((self.first_feet(stage), self.places), |h| (h.feet, h.places));
        let both = stage.support(places);
        match feet {
            Feet::Both => both,
            // a runner's mass sways little: the next foot is always on its way
            Feet::One(s) if self.kind.pattern == Pattern::Running => both.lerp(stage.support([places[s]; 2]), 0.2),
            Feet::One(s) => stage.support([places[s]; 2]),
        }
    }

    fn first_feet(&self, stage: &Stage) -> Feet {
        if self.kind.pattern == Pattern::OneLeg { Feet::One(self.standing(stage)) } else { Feet::Both }
    }
    fn standing(&self, stage: &Stage) -> usize {
        usize::from(!stage.style.left_footed)
    }
    fn first_side(&self) -> usize {
        match self.hops.first().map(|h| h.feet) {
            Some(Feet::One(side)) => side,
            _ => 0,
        }
    }

    /// Hops done, as a running number: whole in the middle of each stance.
    fn beats(&self, t: f64) -> f64 {
        let middle = |i: usize| {
            let from = if i == 0 { self.push_off } else { self.hops[i - 1].landing };
            let to = self.hops.get(i).map_or(from + 0.25, |h| h.takeoff);
            0.5 * (from + to)
        };
        if t <= middle(0) {
            return 0.0;
        }
        (0..self.hops.len())
            .find(|&i| t < middle(i + 1))
            .map_or(self.hops.len() as f64, |i| i as f64 + (t - middle(i)) / (middle(i + 1) - middle(i)))
    }

    fn swing_arm(&self, stage: &Stage, p: &mut Posture, side: usize, beat: f64, size: f64) {
        let own = size * stage.size_of(side) / stage.size();
        let wave = |lag: f64| (2.0 * PI * beat - lag).cos();
        let arm = &mut p.arms[side];
        match self.kind.pattern {
            Pattern::Loose => {
                arm.elevation += 0.15 + 0.14 * own * wave(0.6);
                arm.azimuth = 0.5;
                arm.elbow += 0.35 + 0.28 * own * wave(1.3);
                arm.collar.z = -0.08 * own * wave(0.5);
            }
            Pattern::Stiff => {
                arm.elevation += 0.03 * own * wave(0.4);
                arm.elbow *= 0.6;
                arm.collar.z = -0.03 * own * wave(0.4);
            }
            Pattern::Jacks => {
                let up = 0.5 - 0.5 * (PI * beat).cos();
                let top = (2.55 * (0.85 + 0.15 * own)).min(2.75);
                arm.elevation += (top - arm.elevation) * up * self.reached();
                arm.azimuth = 0.12;
                arm.elbow += 0.15 * (PI * beat).sin().powi(2);
            }
            Pattern::OneLeg => {
                arm.elevation += 0.4 + 0.15 * own * wave(0.5);
                arm.elbow += 0.5 + 0.2 * own * wave(1.2);
                arm.azimuth = 0.45;
            }
            Pattern::Running => {
                let lead = if side == self.first_side() { -1.0 } else { 1.0 };
                let swing = lead * (PI * beat).sin();
                arm.azimuth = AHEAD - 0.3;
                arm.elevation = 0.05 + 0.55 * own * swing;
                arm.elbow = stage.style.elbow_carriage + 1.15 + 0.15 * own * swing;
                arm.bend = DVec3::new(-0.2, 0.4, 1.0);
            }
        }
    }

    /// 1 once there is a hop to swing the arms for.
    fn reached(&self) -> f64 {
        f64::from(u8::from(!self.hops.is_empty()))
    }
}

/// Hops until the clip ends, or until the first landing after the stop; and whether they end.
fn plan(kind: &Kind, stage: &Stage, places: [DVec2; 2], peak: f64, push_off: f64) -> (Vec<Hop>, bool) {
    let tempo = stage.style.tempo * stage.take.tempo;
    // counted hops measure the flesh: they are the same for everybody
    let flight = |i: usize| match kind.hops {
        Some(_) => kind.flight,
        None => {
            (kind.flight * stage.size().sqrt() * stage.cycle(i) / tempo).clamp(0.7 * kind.flight, 1.35 * kind.flight)
        }
    };
    let lead = usize::from(stage.style.left_footed);
    let standing = usize::from(!stage.style.left_footed);
    let rise = |i: usize| 0.5 * GRAVITY * flight(i);
    let mut takeoff = push_off + PUSH_OFF;
    let mut hops = Vec::new();
    while takeoff < stage.duration + 0.5 {
        let i = hops.len();
        let landing = takeoff + flight(i);
        let last = kind.hops.is_some_and(|n| i + 1 >= n) || stage.stop.is_some_and(|stop| landing >= stop);
        let feet = match kind.pattern {
            Pattern::Running if !last => Feet::One((lead + i) % 2),
            Pattern::OneLeg if !last => Feet::One(standing),
            _ => Feet::Both,
        };
        let apart = if kind.pattern == Pattern::Jacks && i % 2 == 0 && !last {
            stage.places(2.6 * stage.size().min(1.1))
        } else {
            places
        };
        let scatter = |k: usize| 0.02 * (stage.cycle(2 * i + k + 7) - 1.0) / 0.05;
        let places =
            std::array::from_fn(|s| if last { places[s] } else { apart[s] + DVec2::new(scatter(0), scatter(1)) });
        hops.push(Hop { takeoff, landing, feet, places });
        if last {
            return (hops, true);
        }
        let ends = Ends { speed: [-rise(i), rise(i + 1)], height: [0.0; 2] };
        takeoff = landing + Phase::duration_for_peak(Force::Bounce, ends, peak);
    }
    (hops, false)
}

/// When and where each foot bears.
fn footings(kind: &Kind, hops: &[Hop], places: [DVec2; 2], finished: bool) -> [Footing; 2] {
    let first = hops.first().map_or(ALWAYS, |h| h.takeoff);
    std::array::from_fn(|side| {
        // the idle leg of a one-legged hop is lifted before the first push
        let idle = kind.pattern == Pattern::OneLeg && !hops.first().is_none_or(|h| h.feet.bears(side));
        let mut plants = vec![Plant { from: -ALWAYS, to: if idle { 0.45 } else { first }, place: places[side] }];
        for (i, hop) in hops.iter().enumerate() {
            if hop.feet.bears(side) {
                let rests = finished && i + 1 == hops.len();
                let to = hops.get(i + 1).map_or(if rests { ALWAYS } else { hop.landing + 0.3 }, |next| next.takeoff);
                plants.push(Plant { from: hop.landing, to, place: hop.places[side] });
            }
        }
        Footing(plants)
    })
}
