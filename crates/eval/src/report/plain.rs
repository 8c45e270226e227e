//! The tables as text, for the terminal and for files that are read as they are.

use super::text::{by_rank, is_channel};
use crate::{MethodMetrics, Metrics, SubspaceMetrics};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

/// Every table that the measures fill, each under a line that says what it is.
pub fn tables(metrics: &Metrics) -> String {
    let parts = [
        judged(metrics),
        methods(metrics),
        energies(metrics),
        dynamics(metrics),
        decays(metrics),
        channels(metrics),
        sequences(metrics),
        subspace(metrics),
        people(metrics),
        shapes(metrics),
        body_mass(metrics),
        leak(metrics),
        timing(metrics),
    ];
    parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join("\n")
}

/// What was judged.
fn judged(metrics: &Metrics) -> String {
    if metrics.clips.is_empty() {
        return String::new();
    }
    format!(
        "{}: {} of {}, {} frames, {} vertices; seed {}; against {}.\n",
        metrics.protocol,
        count(metrics.clips.len(), "clip", "clips"),
        count(metrics.data.subjects.len(), "person", "people"),
        metrics.data.frames,
        metrics.data.vertices,
        metrics.seed,
        if metrics.truth { "the true deltas" } else { "the scans' deltas" },
    )
}

fn count(n: usize, one: &str, many: &str) -> String {
    format!("{n} {}", if n == 1 { one } else { many })
}

/// The methods from the plainest up, on the main source of pose; the report has the others.
pub fn methods(metrics: &Metrics) -> String {
    let mut table = Table::new(
        "Error of vertices in mm: mean ± deviation over frames. Soft ratio: error over the body's own, soft vertices. \
         Energy: speed over the true one.",
        &["method", "all", "soft", "belly, chest", "soft ratio", "energy"],
    );
    for (name, m) in metrics.main_methods() {
        let of = |region: &str| m.regions.get(region).copied().unwrap_or_default();
        if m.diverged_clips.is_some() {
            table.row(name, [Some("diverged".into())]);
        } else if of("all").mean_mm.is_some() {
            let error = |region: &str| spread(of(region).mean_mm, of(region).frame_std_mm);
            table.row(
                name,
                [
                    error("all"),
                    error("soft"),
                    error("belly-chest"),
                    fixed(m.soft_ratio, 3),
                    fixed(of("soft").energy_ratio, 2),
                ],
            );
        }
    }
    table.finish()
}

/// Whether each part moves as much as it should.
fn energies(metrics: &Metrics) -> String {
    let mut table = Table::new(
        "Energy by region: speed of the deltas over the true one.",
        &["method", "belly", "chest", "buttocks", "thighs", "upper arms"],
    );
    for (name, m) in metrics.main_methods() {
        let of = |region: &str| fixed(m.regions.get(region).and_then(|r| r.energy_ratio), 2);
        let cells = ["belly", "chest", "buttocks", "thighs", "upper-arms"].map(of);
        if cells.iter().any(Option::is_some) && !["body", "mean"].contains(&name) {
            table.row(name, cells);
        }
    }
    table.finish()
}

/// How each method moves, and what it does when the motion stops or does not end.
fn dynamics(metrics: &Metrics) -> String {
    let mut table = Table::new(
        "Dynamics of soft regions: spectral distance in dB, error of the spectrum's peak, lag (positive: late); after the\n\
         motion's end the greatest error of frequency and damping ratio, regions that do not ring, and rms speed 2 s later\n\
         over that before; greatest rms of a long rollout over that in training.",
        &["method", "spectral", "peak, Hz", "lag, ms", "decay, Hz", "damping", "silent", "rest", "long rollout"],
    );
    for (name, m) in metrics.main_methods() {
        let soft = m.regions.get("soft").copied().unwrap_or_default();
        let lag = soft.lag_ms.map(|ms| format!("{ms:+.1}"));
        let rang = m.decay_hz_error.is_some() || m.decay_missing.is_some();
        let cells = [
            fixed(soft.spectral_distance, 2),
            fixed(soft.peak_hz_error, 2),
            lag,
            fixed(m.decay_hz_error, 2),
            fixed(m.decay_damping_error, 3),
            rang.then(|| m.decay_missing.unwrap_or(0).to_string()),
            fixed(m.rest_ratio, 3),
            fixed(m.bounded_ratio, 2),
        ];
        if cells.iter().any(Option::is_some) && !["body", "mean"].contains(&name) {
            table.row(name, cells);
        }
    }
    table.finish()
}

/// Free decay region by region.
fn decays(metrics: &Metrics) -> String {
    let mut methods: Vec<&String> = metrics.decays.iter().flat_map(|d| d.methods.keys()).collect();
    methods.sort_by(|a, b| by_rank(a, b));
    methods.dedup();
    let columns: Vec<&str> = ["region", "truth"].into_iter().chain(methods.iter().map(|m| m.as_str())).collect();
    let mut table = Table::new("Free decay after the motion's end: frequency in Hz and damping ratio.", &columns);
    let text = |f: &crate::DecayFigures| format!("{:.2}, {:.2}", f.hz, f.damping_ratio);
    for d in &metrics.decays {
        let own = methods.iter().map(|m| d.methods.get(*m).map(text));
        table.row(&format!("{}, {}", d.subject, d.region), std::iter::once(Some(text(&d.truth))).chain(own));
    }
    table.finish()
}

/// The same models on other sources of pose.
fn channels(metrics: &Metrics) -> String {
    if !metrics.methods.keys().any(|name| is_channel(name)) {
        return String::new();
    }
    let mut table = Table::new(
        "Soft ratio and energy on other sources of pose: the motion fitted to the test scan, and one with smooth errors of a \
         degree or two.",
        &["method", "main, ratio", "energy", "fitted, ratio", "energy", "rough, ratio", "energy"],
    );
    for (name, main) in metrics.main_methods() {
        let others = ["fitted", "rough"].map(|channel| metrics.methods.get(&format!("{name}/{channel}")));
        if others.iter().all(Option::is_none) {
            continue;
        }
        let of = |m: Option<&MethodMetrics>| {
            let energy = m.and_then(|m| m.regions.get("soft")).and_then(|r| r.energy_ratio);
            [fixed(m.and_then(|m| m.soft_ratio), 3), fixed(energy, 2)]
        };
        let cells = std::iter::once(Some(main)).chain(others).flat_map(of);
        table.row(name, cells);
    }
    table.finish()
}

/// What a protocol left out, clip by clip: the run's method beside the body alone (Casas-Otaduy 2018 fig. 7).
fn sequences(metrics: &Metrics) -> String {
    let Some(method) = metrics.method.as_deref().filter(|_| metrics.protocol != "held-out") else {
        return String::new();
    };
    let mut table = Table::new(
        "What was left out, error in mm: mean ± deviation over frames, the body alone beside the method.",
        &["left out", "clip", "all, body", "all", "belly, chest, body", "belly, chest", "soft ratio"],
    );
    for clip in &metrics.clips {
        let error = |name: &str, region: &str| {
            let r = clip.methods.get(name)?.regions.get(region)?;
            spread(r.mean_mm, r.frame_std_mm)
        };
        let ratio = clip.methods.get(method).and_then(|m| m.soft_ratio);
        let mut cells = vec![Some(clip.id().to_string())];
        for region in ["all", "belly-chest"] {
            cells.extend(["body", method].map(|name| error(name, region)));
        }
        cells.push(fixed(ratio, 3));
        table.row(clip.fold.as_deref().unwrap_or("-"), cells);
    }
    table.finish()
}

/// Autoencoder against principal components (SoftSMPL table 1), and person by person.
fn subspace(metrics: &Metrics) -> String {
    if metrics.subspace.is_empty() {
        return String::new();
    }
    let against = if metrics.subspace.values().any(|s| s.pca_mm.is_some()) { "true deltas" } else { "scan deltas" };
    let mut table = Table::new(
        &format!("Subspaces: mean error in mm against the {against}, and against the scan deltas that went in."),
        &["numbers", "PCA", "autoencoder", "ratio", "PCA, input", "autoencoder, input", "ratio, input"],
    );
    for (size, m) in &metrics.subspace {
        let ratio = |ae: Option<f64>, pca: Option<f64>| fixed(ae.zip(pca).map(|(a, p)| a / p), 3);
        let kept = if m.residual_kept == Some(false) { " (PCA kept)" } else { "" };
        table.row(
            &format!("{size}{kept}"),
            [
                fixed(m.pca_mm, 3),
                fixed(m.ae_mm, 3),
                ratio(m.ae_mm, m.pca_mm),
                fixed(m.scan_pca_mm, 3),
                fixed(m.scan_ae_mm, 3),
                ratio(m.scan_ae_mm, m.scan_pca_mm),
            ],
        );
    }
    let whole = table.finish();
    if metrics.subspace_by_subject.len() < 2 { whole } else { whole + "\n" + &subspace_by_person(metrics, against) }
}

fn subspace_by_person(metrics: &Metrics, against: &str) -> String {
    let sizes: BTreeSet<u32> = metrics.subspace_by_subject.values().flat_map(|t| t.keys().copied()).collect();
    let mut columns = vec!["person".to_owned(), "beta 1".to_owned()];
    columns.extend(sizes.iter().flat_map(|s| [format!("PCA-{s}"), format!("AE-{s}")]));
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table = Table::new(&format!("The same by person: mean error in mm against the {against}."), &columns);
    for (name, rows) in by_shape(metrics, &metrics.subspace_by_subject) {
        let beta = metrics.people.get(name).and_then(|p| p.beta_1);
        let pair = |m: &SubspaceMetrics| [m.pca_mm.or(m.scan_pca_mm), m.ae_mm.or(m.scan_ae_mm)].map(|x| fixed(x, 3));
        let pairs = sizes.iter().flat_map(|size| rows.get(size).map_or([None, None], pair));
        table.row(name, [fixed(beta, 2)].into_iter().chain(pairs));
    }
    table.finish()
}

/// Error by shape: soft ratio of each person.
fn people(metrics: &Metrics) -> String {
    if metrics.people.len() < 2 {
        return String::new();
    }
    let mut methods: Vec<&String> = metrics.people.values().flat_map(|p| p.methods.keys()).collect();
    methods.sort_by(|a, b| by_rank(a, b));
    methods.dedup();
    let people = by_shape(metrics, &metrics.people);
    let mut columns = vec!["method".to_owned()];
    let beta = |b: Option<f64>| b.map_or(String::new(), |b| format!(" ({b:.1})"));
    columns.extend(people.iter().map(|(name, p)| format!("{name}{}", beta(p.beta_1))));
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table =
        Table::new("Soft ratio by person; in brackets the fitted beta 1, which falls as mass rises.", &columns);
    for method in methods.into_iter().filter(|m| *m != "body") {
        table.row(method, people.iter().map(|(_, p)| fixed(p.methods.get(method).and_then(|f| f.soft_ratio), 3)));
    }
    table.finish()
}

/// People from the heaviest to the lightest, by name where the shape is not known.
fn by_shape<'a, T>(metrics: &Metrics, people: &'a BTreeMap<String, T>) -> Vec<(&'a String, &'a T)> {
    let beta = |name: &String| metrics.people.get(name).and_then(|p| p.beta_1).unwrap_or(f64::INFINITY);
    let mut sorted: Vec<(&String, &T)> = people.iter().collect();
    sorted.sort_by(|a, b| beta(a.0).total_cmp(&beta(b.0)));
    sorted
}

/// SoftSMPL fig. 8.
fn shapes(metrics: &Metrics) -> String {
    let curves = metrics.shape_response.iter().map(|(name, c)| (name, c.iter().map(|[b, v]| (*b, *v)).collect()));
    let title =
        "Mean vertex speed of the deltas in mm/s for one motion on bodies of other mass (lower beta 1 is heavier).";
    curve_table(title, "beta 1", curves.collect())
}

/// Dyna sec. 6.3.
fn body_mass(metrics: &Metrics) -> String {
    let table = |title: &str, part: fn(&crate::BmiMetrics) -> f64| {
        let curves = metrics.bmi_response.iter().map(|(n, c)| (n, c.iter().map(|p| (p.bmi, part(p))).collect()));
        curve_table(title, "BMI, kg/m²", curves.collect())
    };
    let speed = "Mean vertex speed of the deltas in mm/s for one motion on bodies of one height.";
    let amplitude = "Amplitude of the same: rms distance of soft vertices from their own mean, mm.";
    let tables = [table(speed, |p| p.speed_mm_s), table(amplitude, |p| p.amplitude_mm)];
    tables.into_iter().filter(|t| !t.is_empty()).collect::<Vec<_>>().join("\n")
}

/// Curves over common values, a row a method.
fn curve_table(title: &str, axis: &str, mut curves: Vec<(&String, Vec<(f64, f64)>)>) -> String {
    let mut values: Vec<f64> = curves.iter().flat_map(|(_, c)| c.iter().map(|p| p.0)).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let mut columns = vec![axis.to_owned()];
    columns.extend(values.iter().map(|v| format!("{v}")));
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let mut table = Table::new(title, &columns);
    curves.sort_by(|a, b| by_rank(a.0, b.0));
    for (name, curve) in &curves {
        let at = |value: &f64| fixed(curve.iter().find(|p| p.0 == *value).map(|p| p.1), 1);
        table.row(name, values.iter().map(at));
    }
    table.finish()
}

/// What a linear probe tells from the motion descriptor.
fn leak(metrics: &Metrics) -> String {
    let mut table = Table::new(
        "What a linear probe tells from the motion descriptor, per cent right (excess over chance in brackets).",
        &["descriptor", "subject", "motion"],
    );
    for (name, m) in &metrics.leak {
        let text = |p: &crate::ProbeMetrics| format!("{:.0} ({:.0})", 100.0 * p.accuracy, 100.0 * p.excess());
        table.row(name, [m.subject.as_ref().map(text), m.motion.as_ref().map(text)]);
    }
    table.finish()
}

/// Time of a frame.
fn timing(metrics: &Metrics) -> String {
    let parts = super::comparisons::timed_parts(metrics);
    let mut columns = vec!["method"];
    columns.extend(&parts);
    columns.extend(["whole", "95 %"]);
    let title = format!("Time of a frame in ms at {} vertices, one core, medians.", metrics.data.vertices);
    let mut table = Table::new(&title, &columns);
    let mut names: Vec<&String> = metrics.timing.keys().filter(|n| !is_channel(n)).collect();
    names.sort_by(|a, b| by_rank(a, b));
    for name in names {
        let t = &metrics.timing[name];
        let whole = [t.whole_ms, t.whole_p95_ms].map(|ms| fixed(Some(ms), 3));
        table.row(name, parts.iter().map(|p| fixed(t.part(p), 3)).chain(whole));
    }
    table.finish()
}

fn fixed(x: Option<f64>, digits: usize) -> Option<String> {
    x.map(|x| format!("{x:.digits$}"))
}

fn spread(mean: Option<f64>, deviation: Option<f64>) -> Option<String> {
    match (mean, deviation) {
        (Some(mean), Some(deviation)) => Some(format!("{mean:.3} ± {deviation:.3}")),
        (mean, _) => fixed(mean, 3),
    }
}

/// Columns as wide as their widest cell, the first one aligned left.
pub(super) struct Table {
    title: String,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub(super) fn new(title: &str, columns: &[&str]) -> Self {
        Self { title: title.to_owned(), rows: vec![columns.iter().map(|c| (*c).to_owned()).collect()] }
    }

    /// A row; what was not measured is a dash.
    pub(super) fn row(&mut self, name: &str, cells: impl IntoIterator<Item = Option<String>>) {
        let cells = cells.into_iter().map(|c| c.unwrap_or_else(|| "-".into()));
        self.rows.push(std::iter::once(name.to_owned()).chain(cells).collect());
    }

    /// A line over the rows that follow.
    pub(super) fn heading(&mut self, name: &str) {
        self.rows.push(vec![name.to_owned()]);
    }

    /// The text; empty without a row.
    pub(super) fn finish(self) -> String {
        if self.rows.len() < 2 {
            return String::new();
        }
        let columns = self.rows[0].len();
        let width = |i: usize| self.rows.iter().filter_map(|r| r.get(i)).map(|c| c.chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns).map(width).collect();
        let mut out = self.title + "\n";
        for row in &self.rows {
            let mut line = String::new();
            for (i, (cell, width)) in row.iter().zip(&widths).enumerate() {
                let _ = if i == 0 { write!(line, "{cell:<width$}") } else { write!(line, "   {cell:>width$}") };
            }
            out += line.trim_end();
            out.push('\n');
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BmiMetrics, MethodMetrics, PersonFigures, PersonMetrics, RegionMetrics, Tally, TimingMetrics};

    fn metrics() -> Metrics {
        let mut m = Tally::default().metrics("held-out", 1);
        let region = RegionMetrics { mean_mm: Some(1.5), frame_std_mm: Some(0.25), ..Default::default() };
        let soft = RegionMetrics { energy_ratio: Some(0.8), ..region };
        let regions = [("all", region), ("soft", soft)].map(|(n, r)| (n.to_owned(), r));
        let method = MethodMetrics { regions: regions.into(), soft_ratio: Some(0.6), ..Default::default() };
        m.methods.insert("dyna".into(), method.clone());
        m.methods.insert("dyna/fitted".into(), method);
        m.methods.insert("body".into(), MethodMetrics { diverged_clips: Some(1), ..Default::default() });
        m
    }

    fn line<'a>(text: &'a str, start: &str) -> Vec<&'a str> {
        let line = text.lines().find(|l| l.starts_with(start)).unwrap_or_else(|| panic!("no {start} in:\n{text}"));
        line.split("  ").map(str::trim).filter(|c| !c.is_empty()).collect()
    }

    #[test]
    fn rows_stand_in_line_and_only_what_was_measured_has_a_table() {
        let mut m = metrics();
        m.methods.remove("dyna/fitted");
        let text = tables(&m);
        assert_eq!(line(&text, "dyna"), ["dyna", "1.500 ± 0.250", "1.500 ± 0.250", "-", "0.600", "0.80"]);
        assert!(text.contains("diverged"));
        assert_eq!(text.matches("\n\n").count(), 0, "one table:\n{text}");
        let ends: Vec<usize> =
            text.lines().skip(1).filter(|l| !l.contains("diverged")).map(|l| l.chars().count()).collect();
        assert!(ends.windows(2).all(|w| w[0] == w[1]), "{text}");
    }

    #[test]
    fn other_poses_and_regions_have_tables_of_their_own() {
        let mut m = metrics();
        let belly = RegionMetrics { energy_ratio: Some(0.95), ..Default::default() };
        m.methods.get_mut("dyna").expect("dyna").regions.insert("belly".into(), belly);
        let text = tables(&m);
        assert!(!text.contains("dyna/fitted"), "{text}");
        let after = |title: &str| text.split(title).nth(1).expect("a table");
        assert_eq!(line(after("Energy by region"), "dyna"), ["dyna", "0.95", "-", "-", "-", "-"]);
        let poses = ["dyna", "0.600", "0.80", "0.600", "0.80", "-", "-"];
        assert_eq!(line(after("other sources of pose"), "dyna"), poses);
    }

    #[test]
    fn every_measure_has_its_table() {
        let mut m = metrics();
        m.data.vertices = 6890;
        m.shape_response.insert("dyna".into(), vec![[-2.5, 30.0], [0.5, 10.0]]);
        let point = |bmi, speed_mm_s| BmiMetrics { bmi, speed_mm_s, amplitude_mm: 0.1 * speed_mm_s };
        m.bmi_response.insert("oracle".into(), vec![point(18.0, 12.0), point(34.0, 60.0)]);
        m.bmi_response.insert("dyna".into(), vec![point(18.0, 10.0)]);
        let part = |part: &str, ms| crate::timing::PartTime { part: part.into(), ms };
        let parts = vec![part("descriptor", 0.1), part("decoder", 0.4)];
        m.timing.insert("dyna".into(), TimingMetrics { frames: 300, parts, whole_ms: 0.6, whole_p95_ms: 0.7 });
        let row =
            SubspaceMetrics { pca_mm: Some(2.0), ae_mm: Some(1.8), residual_kept: Some(false), ..Default::default() };
        m.subspace.insert(50, row);
        for (name, beta_1, soft_ratio) in [("s00", 1.5, 0.7), ("s01", -2.0, 0.5)] {
            m.subspace_by_subject.insert(name.into(), [(50, row)].into());
            let figures = PersonFigures { mean_mm: 1.0, soft_ratio: Some(soft_ratio), ..Default::default() };
            let methods = [("dyna".to_owned(), figures)].into();
            m.people.insert(name.into(), PersonMetrics { beta_1: Some(beta_1), methods });
        }
        let text = tables(&m);
        assert_eq!(line(&text, "beta 1"), ["beta 1", "-2.5", "0.5"]);
        assert_eq!(line(&text, "BMI"), ["BMI, kg/m²", "18", "34"]);
        assert_eq!(line(&text, "oracle"), ["oracle", "12.0", "60.0"]);
        let amplitude = text.split("Amplitude of the same").nth(1).expect("a table");
        assert_eq!(line(amplitude, "oracle"), ["oracle", "1.2", "6.0"]);
        assert_eq!(line(&text, "50"), ["50 (PCA kept)", "2.000", "1.800", "0.900", "-", "-", "-"]);
        // the heaviest first
        assert_eq!(line(&text, "person"), ["person", "beta 1", "PCA-50", "AE-50"]);
        assert!(text.find("s01").unwrap() < text.find("s00").unwrap(), "{text}");
        assert!(text.contains("s01 (-2.0)") && text.contains("at 6890 vertices"), "{text}");
        let timed = text.split("Time of a frame").nth(1).expect("a table");
        assert_eq!(line(timed, "method"), ["method", "descriptor", "decoder", "whole", "95 %"]);
        assert_eq!(line(timed, "dyna"), ["dyna", "0.100", "0.400", "0.600", "0.700"]);
    }

    #[test]
    fn what_rings_on_is_told_for_each_method_and_region() {
        let mut m = metrics();
        let dyna = m.methods.get_mut("dyna").expect("dyna");
        (dyna.decay_hz_error, dyna.decay_damping_error, dyna.decay_missing) = (Some(0.5), Some(0.04), Some(2));
        (dyna.rest_ratio, dyna.bounded_ratio) = (Some(0.006), Some(1.1));
        dyna.regions.get_mut("soft").expect("soft").lag_ms = Some(12.0);
        let figures = |hz, damping_ratio| crate::DecayFigures { hz, damping_ratio, explained: 1.0 };
        let decay = |methods| crate::DecayMetrics {
            subject: "s07".into(),
            region: "belly".into(),
            truth: figures(3.1, 0.2),
            methods,
        };
        m.decays = vec![decay([("dyna".to_owned(), figures(4.4, 0.13))].into()), decay([].into())];
        let text = tables(&m);
        let dynamics = text.split("Dynamics of soft regions").nth(1).expect("a table");
        assert_eq!(line(dynamics, "dyna"), ["dyna", "-", "-", "+12.0", "0.50", "0.040", "2", "0.006", "1.10"]);
        assert_eq!(line(&text, "s07, belly"), ["s07, belly", "3.10, 0.20", "4.40, 0.13"]);
        assert_eq!(text.matches("3.10, 0.20   ").count(), 2, "{text}");
        assert!(text.lines().any(|l| l.starts_with("s07, belly") && l.ends_with(" -")), "{text}");
    }

    #[test]
    fn a_protocol_shows_what_it_left_out_beside_the_body() {
        let mut m = metrics();
        m.protocol = "leave-one-sequence-out".into();
        m.method = Some("dyna".into());
        let of = |mm| {
            let region = RegionMetrics { mean_mm: Some(mm), frame_std_mm: Some(0.5), ..Default::default() };
            let regions = ["all", "belly-chest"].map(|n| (n.to_owned(), region));
            MethodMetrics { regions: regions.into(), soft_ratio: Some(0.9), ..Default::default() }
        };
        m.clips.push(crate::ClipMetrics {
            subject: "s01".into(),
            motion: "hips".into(),
            take: 0,
            fold: Some("s01/hips".into()),
            methods: [("body".to_owned(), of(4.0)), ("dyna".to_owned(), of(3.0))].into(),
        });
        let text = tables(&m);
        let (body, own) = ("4.000 ± 0.500", "3.000 ± 0.500");
        assert_eq!(line(&text, "s01/hips"), ["s01/hips", "s01/hips.0", body, own, body, own, "0.900"]);
    }
}
