use crate::{BundleError, Result};

/// When deltas that cannot be trusted fade out, and how fast.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fade {
    /// Trust under which a frame counts as unknown, 0 to 1; 0 never fades. Default 0.5.
    pub below: f32,
    /// For how long the motion must be unknown before the deltas fade, and known before they come back, seconds, 0 to 10. Default
    /// 0.2: a heel strike is no reason.
    pub patience: f32,
    /// How long fading takes, either way, seconds, 0.05 to 10. Default 0.5.
    pub seconds: f32,
}

impl Default for Fade {
    fn default() -> Self {
        Self { below: 0.5, patience: 0.2, seconds: 0.5 }
    }
}

impl Fade {
    /// Lasts for good.
    const NEVER: Self = Self { below: 0.0, patience: 0.0, seconds: 0.5 };

    fn check(&self) -> Result<()> {
        let fields = [
            ("a threshold of trust", self.below, 0.0..=1.0),
            ("a patience", self.patience, 0.0..=10.0),
            ("a fading time", self.seconds, 0.05..=10.0),
        ];
        match fields.into_iter().find(|(_, value, range)| !range.contains(value)) {
            Some((name, value, range)) => {
                Err(BundleError::Input(format!("{name} of {value}; give {} to {}", range.start(), range.end())))
            }
            None => Ok(()),
        }
    }
}

/// Follows the trust of a motion and says how much of the deltas is shown.
#[derive(Clone, Debug)]
pub(crate) struct Fader {
    fade: Fade,
    unknown: bool,
    /// For how long, all in all, the trust has been on the other side of the threshold, seconds.
    other_side: f32,
    /// In `[0, 1]`, linear in time.
    level: f32,
}

impl Fader {
    pub(crate) fn new() -> Self {
        Self { fade: Fade::NEVER, unknown: false, other_side: 0.0, level: 1.0 }
    }
    pub(crate) fn set(&mut self, fade: Option<Fade>) -> Result<()> {
        let fade = fade.unwrap_or(Fade::NEVER);
        fade.check()?;
        self.fade = fade;
        Ok(())
    }
    pub(crate) fn reset(&mut self) {
        (self.unknown, self.other_side, self.level) = (false, 0.0, 1.0);
    }
    /// A frame of `seconds`.
    pub(crate) fn step(&mut self, trust: f32, seconds: f32) {
        if (trust < self.fade.below) != self.unknown {
            self.other_side += seconds;
            if self.other_side >= self.fade.patience {
                (self.unknown, self.other_side) = (!self.unknown, 0.0);
            }
        } else {
            // A known frame between unknown ones does not begin the count anew.
            self.other_side = (self.other_side - seconds).max(0.0);
        }
        let by = seconds / self.fade.seconds;
        self.level = (self.level + if self.unknown { -by } else { by }).clamp(0.0, 1.0);
    }
    /// Part of the deltas that is shown, smooth in time.
    pub(crate) fn factor(&self) -> f32 {
        self.level * self.level * (3.0 - 2.0 * self.level)
    }
}
