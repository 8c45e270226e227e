//! Rows of a table: what is wanted, what was measured, whether it is met.

/// Collects rows and prints them as they come.
#[derive(Default)]
pub struct Table {
    met: usize,
    missed: usize,
}

impl Table {
    pub fn head(&self) {
        println!("| figure | wanted | measured | |\n|---|---|---|---|");
    }

    /// A figure that must lie within `low..=high`.
    pub fn within(&mut self, name: &str, value: f64, low: f64, high: f64, unit: &str) {
        let wanted = match (low.is_finite(), high.is_finite()) {
            (true, true) => format!("{low} to {high} {unit}"),
            (true, false) => format!("at least {low} {unit}"),
            _ => format!("at most {high} {unit}"),
        };
        self.row(name, &wanted, &format!("{value:.4} {unit}"), value >= low && value <= high);
    }

    pub fn at_least(&mut self, name: &str, value: f64, low: f64, unit: &str) {
        self.within(name, value, low, f64::INFINITY, unit);
    }

    pub fn at_most(&mut self, name: &str, value: f64, high: f64, unit: &str) {
        self.within(name, value, f64::NEG_INFINITY, high, unit);
    }

    pub fn row(&mut self, name: &str, wanted: &str, measured: &str, met: bool) {
        if met {
            self.met += 1
        } else {
            self.missed += 1
        }
        println!("| {name} | {} | {} | {} |", wanted.trim(), measured.trim(), if met { "met" } else { "MISSED" });
    }

    /// A figure without a demand.
    pub fn note(&self, name: &str, measured: &str) {
        println!("| {name} | | {measured} | |");
    }

    pub fn finish(&self) -> usize {
        println!("\n{} met, {} missed", self.met, self.missed);
        self.missed
    }
}
