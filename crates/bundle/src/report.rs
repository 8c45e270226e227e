/// What a step had to do to stay sane, and how far its motion lies from what training has seen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepReport {
    /// The pose was unusable (not finite, absurdly large, or of another number of joints): the last good one stands in.
    pub pose_held: bool,
    /// The root jumped; the jump was not taken for motion.
    pub teleported: bool,
    /// Features outside their range in training, clipped to it.
    pub features_clipped: usize,
    /// The motion started over: the state was no longer finite, or too much time had passed.
    pub restarted: bool,
    /// The time step was no positive number.
    pub time_ignored: bool,
    /// No delta yet: the model looks ahead and has not seen far enough.
    pub waiting: bool,
    /// 1 for motions and bodies like those of the training, 0 far away from them and where there is no motion to judge: a
    /// pose was held, the root jumped. Of several frames the least.
    pub trust: f32,
}

/// The sum of the steps' reports over a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RolloutReport {
    /// Frames played.
    pub frames: usize,
    /// Frames whose pose was held.
    pub poses_held: usize,
    /// Teleports.
    pub teleports: usize,
    /// Frames with clipped features.
    pub frames_clipped: usize,
    /// Times the state started over.
    pub restarts: usize,
    /// Least trust of a frame.
    pub least_trust: f32,
    /// The first frame with it.
    pub least_trust_frame: usize,
}

impl Default for StepReport {
    /// Nothing had to be done.
    fn default() -> Self {
        Self {
            pose_held: false,
            teleported: false,
            features_clipped: 0,
            restarted: false,
            time_ignored: false,
            waiting: false,
            trust: 1.0,
        }
    }
}

impl StepReport {
    /// Both, as one.
    pub(crate) fn add(&mut self, other: Self) {
        self.pose_held |= other.pose_held;
        self.teleported |= other.teleported;
        self.features_clipped = self.features_clipped.max(other.features_clipped);
        self.restarted |= other.restarted;
        self.time_ignored |= other.time_ignored;
        self.waiting = other.waiting;
        self.trust = self.trust.min(other.trust);
    }
}

impl Default for RolloutReport {
    /// Of no frame.
    fn default() -> Self {
        Self {
            frames: 0,
            poses_held: 0,
            teleports: 0,
            frames_clipped: 0,
            restarts: 0,
            least_trust: 1.0,
            least_trust_frame: 0,
        }
    }
}

impl RolloutReport {
    /// Adds what was done for the deltas of `frame`.
    pub(crate) fn add(&mut self, frame: usize, step: &StepReport) {
        self.poses_held += usize::from(step.pose_held);
        self.teleports += usize::from(step.teleported);
        self.frames_clipped += usize::from(step.features_clipped > 0);
        self.restarts += usize::from(step.restarted);
        if step.trust < self.least_trust {
            (self.least_trust, self.least_trust_frame) = (step.trust, frame);
        }
    }
}
