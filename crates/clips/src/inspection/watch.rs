use super::likeness::{FOLLOWED, REMEMBERED, dropped, resemblance};
use super::steps::Steps;
use super::{Place, Problem, ProblemKind};
use glam::Vec3;
use std::collections::VecDeque;

/// Slower sequences make a gesture in a few frames: nothing is said of dropped ones.
const SLOWEST_FPS: f32 = 24.0;
/// Normalised determinant of the covariance of two frames: 1 where points keep their places, -1 where left and right
/// are exchanged, 0 where anything is.
const EXCHANGED: f64 = -0.2;
const SHUFFLED: f64 = 0.2;
/// Share of the points that jump where vertices change places.
const JUMPING: f32 = 0.2;

/// What counts as wrong in a sequence of points. Metres, seconds, Y up.
#[derive(Clone, Copy, Debug)]
pub struct WatchConfig {
    /// Points faster than this jump, m/s. Default 30: a fist makes 12, flesh on it a little more.
    pub fastest: f32,
    /// The middle of the points jumps where it leaves the straight way by more than this...
    pub jump_m: f32,
    /// ... and more than this acceleration moves it in a frame, m/s². Default 0.08 and 100: landings make 50.
    pub jump_m_s2: f32,
    /// Points lower than this under `y = 0` are below the floor; `None` where there is no floor. Default 0.1.
    pub floor_m: Option<f32>,
    /// Whether the points are places on a body, which keeps its shape from frame to frame, and not displacements.
    /// Default true.
    pub is_body: bool,
}

impl Default for WatchConfig {
    fn default() -> Self {
        Self { fastest: 30.0, jump_m: 0.08, jump_m_s2: 100.0, floor_m: Some(0.1), is_body: true }
    }
}

impl WatchConfig {
    /// For joints, which are slower than skin (20 m/s) and whose floor is not known as well (0.15 m).
    pub fn joints() -> Self {
        Self { fastest: 20.0, floor_m: Some(0.15), ..Self::default() }
    }

    /// For displacements of points, which have no floor and may turn round from one frame to the next.
    pub fn deltas() -> Self {
        Self { floor_m: None, is_body: false, ..Self::default() }
    }
}

/// Watches points frame by frame: numbers that are none, repeated and dropped frames, jumps, left and right exchanged,
/// changes of order or count, the floor.
pub struct SequenceWatch {
    config: WatchConfig,
    fps: f32,
    names: Vec<String>,
    template: Vec<Vec3>,
    before: Vec<Vec3>,
    middle: Option<(Vec3, Vec3)>,
    followed: VecDeque<(usize, Vec<Vec3>)>,
    suspects: Vec<(usize, f32)>,
    steps: Steps,
    bounds: Option<[Vec3; 2]>,
    frames: usize,
    low: Low,
    mirrored: usize,
    fastest: f32,
    found: Vec<Problem>,
}

#[derive(Default)]
struct Low {
    places: Vec<usize>,
    deepest: f32,
}

impl SequenceWatch {
    /// Nothing seen yet, of a sequence at `fps` frames a second.
    pub fn new(fps: f32, config: WatchConfig) -> Self {
        Self {
            config,
            fps,
            names: vec![],
            template: vec![],
            before: vec![],
            middle: None,
            followed: VecDeque::new(),
            suspects: vec![],
            steps: Steps::default(),
            bounds: None,
            frames: 0,
            low: Low::default(),
            mirrored: 0,
            fastest: 0.0,
            found: vec![],
        }
    }

    /// Names of the points, which are joints then.
    pub fn named(self, names: Vec<String>) -> Self {
        Self { names, ..self }
    }

    /// The points at rest, standing upright, to tell whether the whole sequence is mirrored.
    pub fn template(self, template: Vec<Vec3>) -> Self {
        Self { template, ..self }
    }

    /// The next frame, with its number. Numbers that are passed over are frames that are not there.
    pub fn frame(&mut self, t: usize, points: &[Vec3]) {
        self.frames += 1;
        self.not_finite(t, points);
        let sound = points.iter().filter(|p| p.is_finite());
        let mut here: Option<[Vec3; 2]> = None;
        for p in sound {
            let [low, high] = here.unwrap_or([*p; 2]);
            here = Some([low.min(*p), high.max(*p)]);
        }
        let Some([low, high]) = here else { return };
        self.bounds = Some(self.bounds.map_or([low, high], |[l, h]| [l.min(low), h.max(high)]));
        if let Some(floor) = self.config.floor_m.filter(|floor| low.y < -floor) {
            self.low.places.push(t);
            self.low.deepest = self.low.deepest.min(low.y).min(-floor);
        }
        let follows = self.followed.back().is_none_or(|(before, _)| before + 1 == t);
        if !follows {
            self.forget();
        }
        if !self.before.is_empty() && self.before.len() != points.len() {
            let says = format!("{} points after {}", points.len(), self.before.len());
            self.add(ProblemKind::TopologyChange, says, Place::frame(t));
            self.forget();
        }
        if self.before.len() == points.len() {
            self.compare(t, points);
        } else {
            self.middle = Some((middle(points), Vec3::ZERO)).filter(|(m, _)| m.is_finite());
        }
        if self.template.len() == points.len() && resemblance(&self.template, points).is_some_and(|r| r < EXCHANGED) {
            self.mirrored += 1;
        }
        self.follow(t, points);
        self.before.clear();
        self.before.extend_from_slice(points);
    }

    fn forget(&mut self) {
        self.before.clear();
        self.followed.clear();
        self.middle = None;
    }

    fn place(&self, t: usize, point: usize) -> Place {
        let place = match self.names.get(point) {
            Some(name) => Place::joint(name),
            None => Place::vertex(point as u32),
        };
        place.in_frame(t)
    }

    fn not_finite(&mut self, t: usize, points: &[Vec3]) {
        if let Some(first) = points.iter().position(|p| !p.is_finite()) {
            let place = self.place(t, first);
            self.add(ProblemKind::NotFinite, "coordinates are NaN or infinite".into(), place);
        }
    }

    /// Adds a place to the problem of this kind; what the first one says stands.
    fn add(&mut self, kind: ProblemKind, says: String, place: Place) {
        match self.found.iter_mut().find(|p| p.kind == kind) {
            Some(problem) => problem.add(place),
            None => self.found.push(Problem::at(kind, says, [place])),
        }
    }

    fn compare(&mut self, t: usize, points: &[Vec3]) {
        if self.before == points {
            self.steps.push(t, 0.0);
            return;
        }
        let (m, before) = (middle(points), &self.before);
        let (was, velocity) = self.middle.unwrap_or((m, Vec3::ZERO));
        let (mut farthest, mut which, mut jumping) = (0.0f32, 0, 0);
        let limit = self.config.fastest / self.fps;
        for (i, (a, b)) in before.iter().zip(points).enumerate() {
            let way = a.distance(*b);
            jumping += usize::from(way > limit);
            if way > farthest {
                (farthest, which) = (way, i);
            }
        }
        let leap = (m - was - velocity).length();
        let allowed = self.config.jump_m.max(self.config.jump_m_s2 / (self.fps * self.fps));
        self.steps.push(t, farthest);
        // a first step has no velocity before it
        let leaps = self.followed.len() > 1 && leap > allowed;
        let alike = resemblance(before, points).filter(|_| self.config.is_body);
        let mixed = jumping as f32 > JUMPING * points.len() as f32 || leap < allowed;
        let place = self.place(t, which);
        if farthest > limit || leaps || alike.is_some_and(|r| r < EXCHANGED) {
            match alike {
                Some(r) if r < EXCHANGED => {
                    self.add(ProblemKind::LeftRightSwap, "left and right change places".into(), Place::frame(t));
                }
                Some(r) if r < SHUFFLED && mixed && points.len() > 3 => {
                    self.add(ProblemKind::OrderChange, "vertices change places".into(), Place::frame(t));
                }
                _ => {
                    let says = format!("the fastest point moves at {:.0} m/s", farthest * self.fps);
                    self.fastest = self.fastest.max(farthest * self.fps);
                    self.add(ProblemKind::Teleport, says, place);
                }
            }
            // what comes after a jump goes on as before it
            self.middle = Some((m, velocity));
            self.followed.clear();
        } else {
            self.middle = Some((m, m - was));
        }
    }

    fn follow(&mut self, t: usize, points: &[Vec3]) {
        let step = points.len().div_ceil(FOLLOWED).max(1);
        self.followed.push_back((t, points.iter().step_by(step).copied().collect()));
        if self.followed.len() > REMEMBERED {
            self.followed.pop_front();
        }
        if self.followed.len() == REMEMBERED
            && self.config.is_body
            && self.fps >= SLOWEST_FPS
            && let Some(times) = dropped(&self.followed)
        {
            self.suspects.push((self.followed[3].0, times));
        }
    }

    /// Lowest and highest corner of all that was seen, metres.
    pub fn range(&self) -> Option<[Vec3; 2]> {
        self.bounds
    }

    /// What is wrong.
    pub fn finish(mut self) -> Vec<Problem> {
        if let Some(teleport) = self.found.iter_mut().find(|p| p.kind == ProblemKind::Teleport) {
            teleport.says = format!("points jump, the fastest at {:.0} m/s", self.fastest);
        }
        let repeated = self.steps.repeated();
        if !repeated.is_empty() {
            let places = repeated.into_iter().map(Place::frame);
            self.found.push(Problem::at(ProblemKind::RepeatedFrames, "frames repeat the one before", places));
        }
        if !self.suspects.is_empty() {
            let most = self.suspects.iter().map(|s| s.1).fold(0.0, f32::max);
            let says =
                format!("the step before is up to {most:.1} times as long as its neighbours are: frames look lost");
            let places = self.suspects.iter().map(|(t, _)| Place::frame(*t));
            self.found.push(Problem::at(ProblemKind::DroppedFrames, says, places));
        }
        if !self.low.places.is_empty() {
            let all = if self.low.places.len() == self.frames {
                ", and no frame above it: is its floor elsewhere?"
            } else {
                ""
            };
            let says = format!("points lie up to {:.2} m below y = 0{all}", -self.low.deepest);
            let places = self.low.places.iter().map(|t| Place::frame(*t));
            self.found.push(Problem::at(ProblemKind::BelowFloor, says, places));
        }
        if 2 * self.mirrored > self.frames {
            let says = "vertices of the left side lie on the right: the sequence is mirrored";
            self.found.push(Problem::new(ProblemKind::LeftRightSwap, says));
        }
        self.found
    }
}

fn middle(points: &[Vec3]) -> Vec3 {
    points.iter().sum::<Vec3>() / points.len() as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    const FPS: f32 = 60.0;

    /// A lopsided cloud of points that walks, sways and swings.
    fn walking(t: f32) -> Vec<Vec3> {
        (0..80)
            .map(|i| {
                let (a, side) = (i as f32, if i % 2 == 0 { 1.0 } else { -1.0 });
                let swing = 0.2 * side * (4.0 * t).sin() * (0.3 * a).cos();
                let at = Vec3::new(side * (0.1 + 0.002 * a), 0.02 + a * 0.02, 0.1 * (0.9 * a).sin() + swing);
                at + Vec3::new(0.05 * (3.0 * t).sin(), 0.02 * (8.0 * t).sin().abs(), 1.2 * t)
            })
            .collect()
    }

    fn watched(change: impl Fn(usize, Vec<Vec3>) -> Vec<Vec3>) -> Vec<Problem> {
        let mut watch = SequenceWatch::new(FPS, WatchConfig::default());
        for t in 0..90 {
            watch.frame(t, &change(t, walking(t as f32 / FPS)));
        }
        watch.finish()
    }

    /// Kinds and the frames of their first places.
    fn told(problems: &[Problem]) -> Vec<(ProblemKind, Vec<usize>)> {
        problems.iter().map(|p| (p.kind, p.first.iter().filter_map(|p| p.frame).collect())).collect()
    }

    #[test]
    fn a_clean_walk_gives_no_finding() {
        assert_eq!(watched(|_, p| p), []);
    }

    #[test]
    fn displacements_may_turn_round() {
        let mut watch = SequenceWatch::new(FPS, WatchConfig::deltas());
        let mut body = SequenceWatch::new(FPS, WatchConfig::default());
        for t in 0..60 {
            let sign = if t % 2 == 0 { 0.01 } else { -0.01 };
            let deltas: Vec<Vec3> = walking(0.0).iter().map(|p| *p * sign).collect();
            watch.frame(t, &deltas);
            body.frame(t, &deltas);
        }
        assert_eq!(watch.finish(), []);
        assert_eq!(body.finish()[0].kind, ProblemKind::LeftRightSwap);
    }

    #[test]
    fn numbers_that_are_none() {
        let found = watched(|t, mut p| {
            if t == 12 {
                p[5].y = f32::NAN;
            }
            p
        });
        assert_eq!(found[0].kind, ProblemKind::NotFinite);
        assert_eq!((found[0].first[0].frame, found[0].first[0].vertex), (Some(12), Some(5)));
    }

    #[test]
    fn frames_that_are_repeated_or_lost() {
        let kept = watched(|t, p| if t == 40 { walking(39.0 / FPS) } else { p });
        assert_eq!(told(&kept)[0], (ProblemKind::RepeatedFrames, vec![40]));
        let lost = watched(|t, p| if t >= 40 { walking((t + 1) as f32 / FPS) } else { p });
        assert_eq!(told(&lost), [(ProblemKind::DroppedFrames, vec![40])]);
        let two = watched(|t, p| if t >= 40 { walking((t + 2) as f32 / FPS) } else { p });
        assert_eq!(told(&two), [(ProblemKind::DroppedFrames, vec![40])]);
    }

    #[test]
    fn a_pause_is_no_repetition() {
        let eased = |t: usize, pause: std::ops::Range<usize>| {
            let gone = if t < pause.start { (pause.start - t) as f32 } else { t.saturating_sub(pause.end) as f32 };
            let sign = if t < pause.start { -1.0 } else { 1.0 };
            walking(0.0).into_iter().map(|p| p + Vec3::Z * sign * 2e-4 * gone.powi(2)).collect::<Vec<_>>()
        };
        assert_eq!(told(&watched(|t, _| eased(t, 0..20))), []);
        assert_eq!(told(&watched(|t, _| eased(t, 30..50))), []);
        assert_eq!(told(&watched(|t, _| eased(t, 70..90))), []);
        assert_eq!(watched(|_, _| walking(0.0))[0].count, 89, "a picture that stands");
    }

    #[test]
    fn points_and_bodies_that_jump() {
        let spike = watched(|t, mut p| {
            if t == 30 {
                p[7].x += 0.8;
            }
            p
        });
        assert_eq!(told(&spike), [(ProblemKind::Teleport, vec![30, 31])]);
        assert_eq!(spike[0].first[0].vertex, Some(7));
        let moved = watched(|t, p| p.into_iter().map(|q| if t >= 30 { q + Vec3::X * 0.2 } else { q }).collect());
        assert_eq!(told(&moved), [(ProblemKind::Teleport, vec![30])]);
    }

    #[test]
    fn vertices_that_change_places() {
        let swapped = watched(|t, mut p| {
            if t >= 50 {
                p.chunks_exact_mut(2).for_each(|pair| pair.swap(0, 1));
            }
            p
        });
        assert_eq!(told(&swapped), [(ProblemKind::LeftRightSwap, vec![50])]);
        let shuffled = watched(|t, p| if t >= 50 { (0..80).map(|i| p[i * 37 % 80]).collect() } else { p });
        assert_eq!(told(&shuffled), [(ProblemKind::OrderChange, vec![50])]);
        let fewer = watched(|t, p| if t == 20 { p[..70].to_vec() } else { p });
        assert_eq!(told(&fewer), [(ProblemKind::TopologyChange, vec![20, 21])]);
    }

    #[test]
    fn a_mirrored_sequence_is_told_by_the_template() {
        let mirrored = |sign: f32| {
            let mut watch = SequenceWatch::new(FPS, WatchConfig::default()).template(walking(0.0));
            (0..20).for_each(|t| {
                let points: Vec<Vec3> =
                    walking(t as f32 / FPS).iter().map(|p| Vec3::new(sign * p.x, p.y, p.z)).collect();
                watch.frame(t, &points);
            });
            told(&watch.finish())
        };
        assert_eq!(mirrored(1.0), []);
        assert_eq!(mirrored(-1.0), [(ProblemKind::LeftRightSwap, vec![])]);
    }

    #[test]
    fn the_floor_and_frames_that_are_not_there() {
        let low = watched(|t, mut p| {
            if t > 86 {
                p[0].y = -0.3;
            }
            p
        });
        assert_eq!(told(&low).last(), Some(&(ProblemKind::BelowFloor, vec![87, 88, 89])));
        let sunk = watched(|_, p| p.into_iter().map(|q| q - Vec3::Y).collect());
        assert_eq!(sunk[0].count, 90);
        assert!(sunk[0].says.contains("elsewhere"));
        // a gap in the numbers is no jump
        let mut watch = SequenceWatch::new(FPS, WatchConfig::default());
        (0..90).filter(|t| !(30..60).contains(t)).for_each(|t| watch.frame(t, &walking(t as f32 / FPS)));
        assert_eq!(watch.finish(), []);
    }
}
