use std::time::{Duration, Instant};

/// Parts of a player's frame that are timed apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepPart {
    /// Posing the body before the model runs and adding the deltas after it.
    Skinning,
    /// The motion descriptor but for its learned pose.
    Descriptor,
    /// The learned pose, where the descriptor has one.
    PoseEncoder,
    /// From features to latent numbers; to the deltas themselves where there is no decoder.
    Regressor,
    /// From latent numbers to deltas.
    Decoder,
    /// From deltas back to latent numbers, where these are fed back (Casas and Otaduy 2018).
    Feedback,
}

impl StepPart {
    /// All of them, in the order in which a frame runs through them.
    pub const ALL: [Self; 6] =
        [Self::Skinning, Self::Descriptor, Self::PoseEncoder, Self::Regressor, Self::Decoder, Self::Feedback];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Skinning => "skinning",
            Self::Descriptor => "descriptor",
            Self::PoseEncoder => "encoder",
            Self::Regressor => "regressor",
            Self::Decoder => "decoder",
            Self::Feedback => "feedback",
        }
    }
}

/// How long one frame took, wall clock.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepTimes {
    parts: [Option<Duration>; StepPart::ALL.len()],
    /// All of it, what stands in no part included.
    pub whole: Duration,
}

impl StepTimes {
    /// The time of a part, where the model has it.
    pub fn part(&self, part: StepPart) -> Option<Duration> {
        self.parts[part as usize]
    }
}

/// Told by a step what it has just finished.
pub(crate) trait Watch {
    /// The time since the last call belongs to `part`.
    fn lap(&mut self, part: StepPart);
}

/// Nobody looks at the clock.
impl Watch for () {
    fn lap(&mut self, _: StepPart) {}
}

/// Looks at the clock.
pub(crate) struct Stopwatch {
    begun: Instant,
    last: Instant,
    times: StepTimes,
}

impl Stopwatch {
    pub(crate) fn start() -> Self {
        let now = Instant::now();
        Self { begun: now, last: now, times: StepTimes::default() }
    }
    pub(crate) fn stop(self) -> StepTimes {
        StepTimes { whole: self.begun.elapsed(), ..self.times }
    }
}

impl Watch for Stopwatch {
    fn lap(&mut self, part: StepPart) {
        let now = Instant::now();
        *self.times.parts[part as usize].get_or_insert_default() += now - self.last;
        self.last = now;
    }
}
