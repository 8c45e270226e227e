//! How long work reports its progress and learns that it should stop. Knows no terminal and no signal.

/// What a stage of long work talks to. The command line draws bars behind it; tests use [`Silent`].
pub trait Monitor: Sync {
    /// A part of the work begins: `total` units of `unit` ("clips", "steps", ...).
    fn begin(&self, part: &str, total: u64, unit: &'static str);
    /// `units` more are done; `note` (may be empty) is shown beside the bar.
    fn advance(&self, units: u64, note: &str);
    /// The part is done.
    fn end(&self);
    /// A line worth keeping.
    fn say(&self, line: &str);
    /// Whether the user asked to stop: save and return at the next safe point.
    fn should_stop(&self) -> bool;
}

/// Says nothing and never stops.
pub struct Silent;

impl Monitor for Silent {
    fn begin(&self, _: &str, _: u64, _: &'static str) {}
    fn advance(&self, _: u64, _: &str) {}
    fn end(&self) {}
    fn say(&self, _: &str) {}
    fn should_stop(&self) -> bool {
        false
    }
}
