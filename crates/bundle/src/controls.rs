use crate::detail::Part;
use crate::{BundleError, Model, ModelState, Result};
use glam::Vec3;
use softtissue_body::{BodyModel, Region};
use softtissue_geometry::Adjacency;

/// What an animator changes of a part of the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Control {
    /// Factor on the deltas, -100 to 100 (Dyna 2015 sec. 6.4 shows 2.5). Default 1.
    pub gain: f32,
    /// Factor on the time in which flesh answers, 0.25 to 4: at 2 it rings at half its frequency. What it does at rest
    /// does not change. It is shown `softness` frames late. Default 1.
    pub softness: f32,
    /// Factor on the damping ratio, 0.1 to 10; models with resonators only, whose recurrent part stays as learned.
    /// Default 1.
    pub damping: f32,
    /// Delay, seconds, 0 to 0.5. Default 0.
    pub lag: f32,
    /// How much heavier the person is whose flesh this is, -3 to 3 in units of `beta[1]`, which falls as mass rises: what
    /// the model knows of heavier people's flesh, on the same body. Default 0.
    pub mass: f32,
}

/// Everything that an animator changes of a body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Controls {
    /// Of the whole body.
    pub everywhere: Control,
    /// Of regions, on top of that: factors multiply, lags and masses add. Edges between regions are blended.
    pub regions: Vec<(Region, Control)>,
    /// Factor on the deltas of each vertex, `[V]`, on top of the rest.
    pub painted: Option<Vec<f32>>,
}

const MOST_GAIN: f32 = 100.0;
const SOFTNESS: std::ops::RangeInclusive<f32> = 0.25..=4.0;
const DAMPING: std::ops::RangeInclusive<f32> = 0.1..=10.0;
const LAG: std::ops::RangeInclusive<f32> = 0.0..=0.5;
const MASS: std::ops::RangeInclusive<f32> = -3.0..=3.0;
/// Rounds in which each vertex becomes the mean of itself and its neighbours, to blend regions into each other.
const BLENDING: usize = 6;

impl Default for Control {
    fn default() -> Self {
        Self { gain: 1.0, softness: 1.0, damping: 1.0, lag: 0.0, mass: 0.0 }
    }
}

impl Control {
    fn on_top_of(self, other: Self) -> Self {
        Self {
            gain: self.gain * other.gain,
            softness: self.softness * other.softness,
            damping: self.damping * other.damping,
            lag: self.lag + other.lag,
            mass: self.mass + other.mass,
        }
    }

    fn check(&self) -> Result<()> {
        let fields = [
            ("gain", self.gain, -MOST_GAIN..=MOST_GAIN),
            ("softness", self.softness, SOFTNESS),
            ("damping", self.damping, DAMPING),
            ("lag", self.lag, LAG),
            ("mass", self.mass, MASS),
        ];
        match fields.into_iter().find(|(_, value, range)| !range.contains(value)) {
            Some((name, value, range)) => Err(BundleError::Input(format!(
                "a {name} of {value}; give {} to {}, everywhere and regions taken together",
                range.start(),
                range.end()
            ))),
            None => Ok(()),
        }
    }

    /// Whether two parts move as one, but for the gain.
    fn rings_like(&self, other: &Self) -> bool {
        let voice = |c: &Self| (c.softness, c.damping, c.lag, c.mass);
        voice(self) == voice(other)
    }
}

impl Controls {
    /// The same factor everywhere.
    pub fn gain(gain: f32) -> Self {
        Self { everywhere: Control { gain, ..Default::default() }, ..Default::default() }
    }

    fn of(&self, region: Region) -> Control {
        let named = self.regions.iter().filter(|(r, _)| *r == region);
        named.fold(self.everywhere, |sum, (_, control)| control.on_top_of(sum))
    }
}

/// A body under control: parts that ring alike share a voice.
#[derive(Clone, Debug)]
pub(crate) struct Mixer {
    voices: Vec<Voice>,
}

/// One way of ringing and where it is heard.
#[derive(Clone, Debug)]
struct Voice {
    /// The bundle's model with other damping; `None` where it is as learned.
    model: Option<Model>,
    /// Factor on this voice's deltas, `[V]`.
    weights: Vec<f32>,
    softness: f32,
    now: Pace,
    /// What the next frame will be like; looked at where something between two frames is shown.
    ahead: Pace,
    delay: Delay,
}

/// A model that runs at a pace of its own.
#[derive(Clone, Debug)]
struct Pace {
    state: ModelState,
    /// Features gathered since the model's last step, times frames, `[D]`, and for how many frames.
    gathered: Vec<f32>,
    filled: f32,
    held: Vec<f32>,
    /// Deltas of the model's last step and of the one before, `[V * 3]`.
    newest: Vec<f32>,
    older: Vec<f32>,
}

/// Deltas of the last frames.
#[derive(Clone, Debug)]
struct Delay {
    /// Frames, the fraction included.
    frames: f32,
    /// `[ceil(frames) + 1][V * 3]`, written round.
    ring: Vec<Vec<f32>>,
    at: usize,
}

impl Mixer {
    /// Prepares the voices. Everything that is needed later is taken here.
    pub(crate) fn new(controls: &Controls, model: &Model, body: &BodyModel, beta: &[f32], fps: f32) -> Result<Self> {
        let v = body.vertex_count();
        if let Some(painted) = &controls.painted {
            if painted.len() != v {
                return Err(BundleError::Input(format!(
                    "{} painted gains where the body has {v} vertices; paint a mesh of its topology",
                    painted.len()
                )));
            }
            if let Some(i) = painted.iter().position(|g| !(-MOST_GAIN..=MOST_GAIN).contains(g)) {
                let message = format!("a painted gain of {} at vertex {i}; give -100 to 100", painted[i]);
                return Err(BundleError::Input(message));
            }
        }
        controls.everywhere.check()?;
        let shares = region_shares(body);
        let mut voices: Vec<(Control, Vec<f32>)> = Vec::new();
        for (region, share) in Region::ALL.into_iter().zip(&shares) {
            let control = controls.of(region);
            control.check()?;
            let place = voices.iter().position(|(c, _)| c.rings_like(&control)).unwrap_or_else(|| {
                voices.push((control, vec![0.0; v]));
                voices.len() - 1
            });
            voices[place].1.iter_mut().zip(share).for_each(|(w, s)| *w += control.gain * s);
        }
        let voice = |(control, mut weights): (Control, Vec<f32>)| {
            if let Some(painted) = &controls.painted {
                weights.iter_mut().zip(painted).for_each(|(w, p)| *w *= p);
            }
            Voice::new(control, weights, model, beta, fps)
        };
        Ok(Self { voices: voices.into_iter().map(voice).collect::<Result<_>>()? })
    }

    /// One frame: features in. Returns how many were clipped.
    pub(crate) fn step(&mut self, model: &Model, features: &[f32], detail: Option<&Part>) -> usize {
        self.voices.iter_mut().map(|voice| voice.step(model, features, detail)).max().unwrap_or(0)
    }

    /// Looks at the next frame.
    pub(crate) fn look_ahead(&mut self, model: &Model, features: &[f32], detail: Option<&Part>) {
        self.voices.iter_mut().for_each(|voice| voice.look_ahead(model, features, detail));
    }

    /// The deltas `[V]` this part of a frame, under 1, after the newest frame. Beyond the frame itself, the next one must
    /// have been looked at.
    pub(crate) fn mix(&self, part: f32, deltas: &mut [Vec3]) {
        deltas.fill(Vec3::ZERO);
        self.voices.iter().for_each(|voice| voice.add_to(part, deltas));
    }

    pub(crate) fn reset(&mut self) {
        self.voices.iter_mut().for_each(Voice::reset);
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.voices.iter().all(|v| v.now.state.is_finite())
    }
}

impl Voice {
    fn new(control: Control, weights: Vec<f32>, model: &Model, beta: &[f32], fps: f32) -> Result<Self> {
        let damped = if control.damping == 1.0 { None } else { Some(with_damping(model, control.damping)?) };
        let size = 3 * weights.len();
        let mut flesh = beta.to_vec();
        flesh.resize(flesh.len().max(2), 0.0);
        flesh[1] -= control.mass;
        let now = Pace::new(damped.as_ref().unwrap_or(model), &flesh, size);
        Ok(Self {
            ahead: now.clone(),
            now,
            model: damped,
            weights,
            softness: control.softness,
            delay: Delay::new(control.lag * fps, size),
        })
    }

    fn step(&mut self, model: &Model, features: &[f32], detail: Option<&Part>) -> usize {
        let clipped = self.now.step(self.model.as_ref().unwrap_or(model), features, self.softness, detail);
        self.delay.push(&self.now.older, &self.now.newest, self.now.part(self.softness));
        clipped
    }

    fn look_ahead(&mut self, model: &Model, features: &[f32], detail: Option<&Part>) {
        // What is heard a frame late needs no look ahead.
        if self.delay.frames < 1.0 {
            self.ahead.remember(&self.now);
            self.ahead.step(self.model.as_ref().unwrap_or(model), features, self.softness, detail);
        }
    }

    fn add_to(&self, part: f32, deltas: &mut [Vec3]) {
        let late = self.delay.frames - part;
        let heard = self.weights.iter().enumerate().filter(|(_, w)| **w != 0.0);
        if late >= 0.0 {
            let (from, to, part) = self.delay.at(late);
            let at = |x: &[f32], v: usize| Vec3::from_slice(&x[3 * v..]);
            heard.for_each(|(v, w)| deltas[v] += *w * at(from, v).lerp(at(to, v), part));
            return;
        }
        let (now, _, _) = self.delay.at(0.0);
        let (Pace { older, newest, .. }, next) = (&self.ahead, self.ahead.part(self.softness));
        let at = |x: &[f32], v: usize| Vec3::from_slice(&x[3 * v..]);
        heard.for_each(|(v, w)| {
            let ahead = at(older, v).lerp(at(newest, v), next);
            deltas[v] += *w * at(now, v).lerp(ahead, -late);
        });
    }

    fn reset(&mut self) {
        self.now.reset();
        self.delay.ring.iter_mut().for_each(|d| d.fill(0.0));
    }
}

impl Pace {
    fn new(model: &Model, beta: &[f32], size: usize) -> Self {
        Self {
            state: model.start(beta),
            gathered: vec![0.0; model.feature_count()],
            filled: 0.0,
            held: vec![0.0; model.feature_count()],
            newest: vec![0.0; size],
            older: vec![0.0; size],
        }
    }

    /// The model's own frames are `softness` frames long: a filter of response `H(f)` becomes one of `H(softness f)`,
    /// whatever the model. Each step sees the mean of the features since the one before, so that no impact is missed.
    fn step(&mut self, model: &Model, features: &[f32], softness: f32, detail: Option<&Part>) -> usize {
        let Self { state, gathered, filled, held, newest, older } = self;
        let (mut left, mut clipped) = (1.0f32, 0);
        // Rounding must not lose a step.
        while *filled + left >= softness - 1e-4 {
            let taken = (softness - *filled).clamp(0.0, left);
            for ((h, g), x) in held.iter_mut().zip(gathered.iter_mut()).zip(features) {
                *h = (*g + taken * x) / softness;
                *g = 0.0;
            }
            std::mem::swap(newest, older);
            clipped = clipped.max(model.step_part(held, state, newest, detail));
            left -= taken;
            *filled = 0.0;
        }
        gathered.iter_mut().zip(features).for_each(|(g, x)| *g += left * x);
        *filled += left;
        clipped
    }

    /// Where the newest frame lies between the model's last two steps.
    fn part(&self, softness: f32) -> f32 {
        if softness == 1.0 { 1.0 } else { self.filled / softness }
    }

    /// Takes over all of another one that the next step needs.
    fn remember(&mut self, other: &Self) {
        self.state.remember(&other.state);
        self.filled = other.filled;
        self.gathered.copy_from_slice(&other.gathered);
        self.newest.copy_from_slice(&other.newest);
        self.older.copy_from_slice(&other.older);
    }

    fn reset(&mut self) {
        self.state.reset();
        self.filled = 0.0;
        self.gathered.fill(0.0);
        self.newest.fill(0.0);
        self.older.fill(0.0);
    }
}

impl Delay {
    fn new(frames: f32, size: usize) -> Self {
        Self { frames, ring: vec![vec![0.0; size]; frames.ceil() as usize + 1], at: 0 }
    }

    /// Takes the newest deltas, which lie between two of the model's steps.
    fn push(&mut self, older: &[f32], newest: &[f32], part: f32) {
        self.at = (self.at + 1) % self.ring.len();
        for (d, (a, b)) in self.ring[self.at].iter_mut().zip(older.iter().zip(newest)) {
            *d = a + part * (b - a);
        }
    }

    /// What was there so many frames ago, the fraction included: a mixture of two kept frames, and the second one's part.
    fn at(&self, frames: f32) -> (&[f32], &[f32], f32) {
        let (n, whole) = (self.ring.len(), frames.floor());
        let back = |frames: usize| &*self.ring[(self.at + n - frames.min(n - 1)) % n];
        (back(whole as usize), back(frames.ceil() as usize), frames - whole)
    }
}

/// The share of each region in each vertex, `[regions][V]`: one inside, falling off across its edge; they sum to one.
pub(crate) fn region_shares(body: &BodyModel) -> Vec<Vec<f32>> {
    let adjacency = Adjacency::new(&body.topology);
    let share = |region: Region| {
        let mut share: Vec<f32> = body.regions.0.iter().map(|r| f32::from(u8::from(*r == region))).collect();
        for _ in 0..BLENDING {
            let mean = |v: usize| {
                let round = adjacency.neighbours(v);
                let sum: f32 = round.iter().map(|n| share[*n as usize]).sum();
                (share[v] + sum) / (1 + round.len()) as f32
            };
            share = (0..share.len()).map(mean).collect();
        }
        share
    };
    Region::ALL.into_iter().map(share).collect()
}

/// The model with the damping ratios of its resonators multiplied.
fn with_damping(model: &Model, factor: f32) -> Result<Model> {
    let bank = model.recurrent().and_then(|m| m.regressor.bank.as_ref());
    let (Some(recurrent), Some(bank)) = (model.recurrent(), bank) else {
        let message = "a damping for a model without resonators; leave it at 1, or use a bundle of method softtissue";
        return Err(BundleError::Input(message.into()));
    };
    let bank = bank.scaled(1.0, factor);
    let mut recurrent = recurrent.clone();
    recurrent.regressor.bank = Some(bank);
    Ok(Model::Recurrent(recurrent))
}
