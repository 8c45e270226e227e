//! Progress on a terminal as a bar with an ETA; in a pipe as a line now and then.

use crate::signals::Signals;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use softtissue_monitor::Monitor;
use std::io::{IsTerminal, Write};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Draws progress on standard error and knows whether the user asked to stop.
pub struct Terminal {
    signals: Signals,
    quiet: bool,
    is_terminal: bool,
    part: Mutex<Option<Part>>,
}

struct Part {
    bar: ProgressBar,
    name: String,
    unit: &'static str,
    begun: Instant,
    /// Units already there when the part began (a resume): they say nothing about speed.
    resumed: Option<u64>,
    told: Instant,
}

/// Seconds between lines in a pipe.
const LINE_EVERY: Duration = Duration::from_secs(20);

impl Terminal {
    /// A monitor that stops when `signals` say so.
    pub fn new(signals: Signals, quiet: bool) -> Self {
        Self { signals, quiet, is_terminal: std::io::stderr().is_terminal(), part: Mutex::new(None) }
    }
    fn part(&self) -> std::sync::MutexGuard<'_, Option<Part>> {
        self.part.lock().unwrap_or_else(std::sync::PoisonError::into_inner)
    }
}

/// A closed pipe on standard error must not end the work.
fn tell(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Holds the work where `SOFTTISSUE_PAUSE_AT=PART:UNITS` says, until a signal comes, so that a test can send one at a
/// known place. `PART:UNITS:deaf` goes on holding after the first signal. In builds for tests alone.
#[cfg(debug_assertions)]
fn wait_for_a_signal(part: &str, done: u64, signals: &Signals) {
    let Ok(place) = std::env::var("SOFTTISSUE_PAUSE_AT") else { return };
    let words: Vec<&str> = place.split(':').collect();
    let [name, units, rest @ ..] = &words[..] else { return };
    if *name != part || units.parse() != Ok(done) {
        return;
    }
    let begun = Instant::now();
    while (!rest.is_empty() || !signals.should_stop()) && begun.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(5));
    }
}

impl Monitor for Terminal {
    fn begin(&self, part: &str, total: u64, unit: &'static str) {
        let target =
            if self.is_terminal && !self.quiet { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(total), target);
        let template =
            format!("  {{prefix:<16}} {{bar:28}} {{pos}}/{{len}} {unit} {{elapsed}} (ETA {{eta}}) {{wide_msg}}");
        if let Ok(style) = ProgressStyle::with_template(&template) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(part.to_owned());
        let now = Instant::now();
        *self.part() = Some(Part { bar, name: part.to_owned(), unit, begun: now, resumed: None, told: now });
    }

    fn advance(&self, units: u64, note: &str) {
        let mut guard = self.part();
        let Some(part) = guard.as_mut() else { return };
        if part.resumed.is_none() && part.begun.elapsed() < Duration::from_millis(50) && units > 1 {
            part.resumed = Some(units);
            part.bar.reset_eta();
        }
        part.bar.inc(units);
        #[cfg(debug_assertions)]
        wait_for_a_signal(&part.name, part.bar.position(), &self.signals);
        if !note.is_empty() {
            part.bar.set_message(note.to_owned());
        }
        if !self.is_terminal && !self.quiet && part.told.elapsed() > LINE_EVERY {
            part.told = Instant::now();
            let (done, total) = (part.bar.position(), part.bar.length().unwrap_or(0));
            let fresh = done.saturating_sub(part.resumed.unwrap_or(0)).max(1);
            let eta = part.begun.elapsed().as_secs_f64() / fresh as f64 * total.saturating_sub(done) as f64;
            tell(&format!("  {}: {done}/{total} {}, ETA {eta:.0} s {note}", part.name, part.unit));
        }
    }

    fn end(&self) {
        if let Some(part) = self.part().take() {
            part.bar.finish_and_clear();
        }
    }

    fn say(&self, line: &str) {
        if self.quiet {
            return;
        }
        match self.part().as_ref() {
            Some(part) if self.is_terminal => part.bar.suspend(|| tell(line)),
            _ => tell(line),
        }
    }

    fn should_stop(&self) -> bool {
        self.signals.should_stop()
    }
}
