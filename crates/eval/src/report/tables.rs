//! Tables and headline figures, readable without any script.

use super::StageTime;
use super::text::{by_rank, duration, escape, is_channel, method_label, number, thousands};
use crate::measures::REPORTED;
use crate::{FitMetrics, Gate, MethodMetrics, Metrics, OURS, ProbeMetrics, RegionMetrics};
use std::fmt::Write;

fn names(metrics: &Metrics, take: impl Fn(&str) -> bool) -> Vec<&str> {
    let mut names: Vec<&str> = metrics.methods.keys().map(String::as_str).filter(|n| take(n)).collect();
    names.sort_by(|a, b| by_rank(a, b));
    names
}

/// Opens a table row for a method.
pub(super) fn method_row(out: &mut String, name: &str) {
    let class = if name == OURS { " class=\"ours\"" } else { "" };
    let _ = write!(out, "<tr{class}><th scope=\"row\">{}</th>", escape(&method_label(name)));
}

pub(super) fn cell(out: &mut String, text: &str, class: &str) {
    let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
    let _ = write!(out, "<td{class}>{text}</td>");
}

pub(super) fn optional(out: &mut String, value: Option<f64>) {
    cell(out, &value.map_or_else(|| "–".into(), number), if value.is_none() { "none" } else { "" });
}

fn optionals(out: &mut String, values: &[Option<f64>]) {
    values.iter().for_each(|v| optional(out, *v));
}

pub(super) fn head(columns: &[&str]) -> String {
    let mut out = "<div class=\"scroll\"><table><thead><tr>".to_owned();
    for c in columns {
        let class = if *c == WORDS { " class=\"words\"" } else { "" };
        let _ = write!(out, "<th scope=\"col\"{class}>{c}</th>");
    }
    out + "</tr></thead><tbody>"
}

/// The one column that holds words.
const WORDS: &str = "What it says";

pub(super) const TAIL: &str = "</tbody></table></div>";

/// The figures a reader looks for first, as cards.
pub fn headline(metrics: &Metrics) -> String {
    let mut out = "<div class=\"cards\">".to_owned();
    let mut card = |label: &str, value: String, note: String, state: Option<bool>| {
        let class = match state {
            Some(true) => " met",
            Some(false) => " missed",
            None => "",
        };
        let _ = write!(
            out,
            "<div class=\"card{class}\"><p class=\"label\">{label}</p><p class=\"value\">{value}</p><p class=\"note\">{note}</p></div>"
        );
    };
    let gate = |name: &str| metrics.gates.get(name);
    if let Some(ours) = metrics.methods.get(OURS) {
        let soft = ours.regions.get("soft").copied().unwrap_or_default();
        if let Some(ratio) = ours.soft_ratio {
            let asked = gate("regressor.soft_ratio")
                .map_or(String::new(), |g| format!("; asked: at most {:.0} %", g.at_most.unwrap_or(f64::NAN) * 100.0));
            let note = format!("of the body's own error on soft parts{asked}");
            card(
                "Soft-tissue error left",
                format!("{:.0}<small>%</small>", ratio * 100.0),
                note,
                gate("regressor.soft_ratio").and_then(|g| g.met),
            );
        }
        if let Some(mean) = soft.mean_mm {
            let alone = metrics.methods.get("body").and_then(|b| b.regions.get("soft")).and_then(|r| r.mean_mm);
            let note = alone.map_or(String::new(), |a| format!("on soft parts; the body alone: {} mm", number(a)));
            card("Mean error", format!("{}<small>mm</small>", number(mean)), note, None);
        }
        if let Some(energy) = soft.energy_ratio {
            let note = "of the true speed; 1 moves as much as the truth, 0 stands still".to_owned();
            card("Energy", number(energy), note, gate("regressor.energy").and_then(|g| g.met));
        }
        if let Some(ratio) = gate("regressor.against_ar2").and_then(|g| g.value) {
            let most = gate("regressor.against_ar2").and_then(|g| g.at_most).unwrap_or(1.0);
            let less = (1.0 - most) * 100.0;
            let note = format!("error against the better per-subject AR(2); asked: at least {less:.0} % less");
            card(
                "Against AR(2)",
                format!("{:+.0}<small>%</small>", (ratio - 1.0) * 100.0).replace('-', "−"),
                note,
                gate("regressor.against_ar2").and_then(|g| g.met),
            );
        }
        if let Some(fps) = ours.frames_per_second {
            card("Speed", thousands(fps.round() as i64), "frames predicted in a second".into(), None);
        }
    }
    let met = metrics.gates.values().filter(|g| g.met == Some(true)).count();
    let measured = metrics.gates.values().filter(|g| g.met.is_some()).count();
    if measured > 0 {
        let open = metrics.gates.len() - measured;
        let note = if open > 0 {
            format!("acceptance values met; {open} not measured here")
        } else {
            "acceptance values met".into()
        };
        card("Acceptance", format!("{met}<small>of {measured}</small>"), note, Some(met == measured));
    }
    out + "</div>"
}

/// Acceptance values, the missed ones first to be seen.
pub fn gates(metrics: &Metrics) -> String {
    let mut rows: Vec<(&String, &Gate)> = metrics.gates.iter().collect();
    let rank = |g: &Gate| match g.met {
        Some(false) => 0,
        Some(true) => 1,
        None => 2,
    };
    rows.sort_by_key(|(name, g)| (rank(g), (*name).clone()));
    let mut out = head(&["Figure", WORDS, "Found", "Asked", ""]);
    for (name, gate) in rows {
        let _ = write!(out, "<tr><th scope=\"row\"><code>{}</code></th>", escape(name));
        cell(&mut out, &escape(&gate.what), "words");
        cell(&mut out, &escape(&gate.found()), "");
        cell(&mut out, &escape(&gate.asked()), "");
        let class = match gate.met {
            Some(true) => "met",
            Some(false) => "missed",
            None => "open",
        };
        let _ = write!(out, "<td><span class=\"chip {class}\">{}</span></td></tr>", gate.verdict());
    }
    out + TAIL
}

/// Mean and standard deviation of the error in every region, one row a method.
pub fn errors(metrics: &Metrics, against_scans: bool) -> String {
    let part =
        |r: &RegionMetrics| if against_scans { r.scan_mean_mm.zip(r.scan_std_mm) } else { r.mean_mm.zip(r.std_mm) };
    let rows = names(metrics, |n| !is_channel(n));
    let of = |name: &str, region: &str| metrics.methods[name].regions.get(region).and_then(part);
    let regions: Vec<&str> = REPORTED.into_iter().filter(|r| rows.iter().any(|n| of(n, r).is_some())).collect();
    let mut columns = vec!["Error, mm"];
    columns.extend(&regions);
    let mut out = head(&columns);
    for name in &rows {
        method_row(&mut out, name);
        for region in &regions {
            let means = || rows.iter().filter_map(|n| of(n, region)).map(|e| e.0);
            let (least, most) = (means().fold(f64::INFINITY, f64::min), means().fold(0.0, f64::max));
            match of(name, region) {
                Some((mean, std)) => {
                    let text = format!("{:.2}<span class=\"pm\">±{:.2}</span>", mean, std);
                    cell(&mut out, &text, if mean <= least && least < most { "best" } else { "" });
                }
                None if metrics.methods[*name].diverged_clips.is_some() => cell(&mut out, "diverged", "none"),
                None => cell(&mut out, "–", "none"),
            }
        }
        out += "</tr>";
    }
    out + TAIL
}

/// Error on soft vertices clip by clip, one column a method; variants are left to the other tables.
pub fn clips(metrics: &Metrics) -> String {
    let methods = names(metrics, |n| !n.contains('/'));
    let labels: Vec<String> = methods.iter().map(|n| escape(&method_label(n))).collect();
    let mut columns = vec!["Soft error, mm"];
    columns.extend(labels.iter().map(String::as_str));
    let mut out = head(&columns);
    for clip in &metrics.clips {
        let _ = write!(out, "<tr><th scope=\"row\">{}</th>", escape(&clip.id().to_string()));
        for name in &methods {
            let soft = clip.methods.get(*name).and_then(|m| m.regions.get("soft"));
            match soft.and_then(|r| r.mean_mm.zip(r.std_mm)) {
                Some((mean, std)) => cell(&mut out, &format!("{mean:.2}<span class=\"pm\">±{std:.2}</span>"), ""),
                None => cell(&mut out, "–", "none"),
            }
        }
        out += "</tr>";
    }
    out + TAIL
}

/// How each method moves: energy, spectrum, peak, lag, rest, bounds.
pub fn motion(metrics: &Metrics) -> String {
    let mut out = head(&[
        "Soft regions",
        "soft ratio",
        "energy",
        "spectral distance, dB",
        "peak error, Hz",
        "lag, ms",
        "rest after 2 s",
        "long rollout",
        "frames / s",
    ]);
    for name in names(metrics, |n| !is_channel(n)) {
        let m = &metrics.methods[name];
        let soft = m.regions.get("soft").copied().unwrap_or_default();
        method_row(&mut out, name);
        optionals(&mut out, &[m.soft_ratio, soft.energy_ratio, soft.spectral_distance, soft.peak_hz_error]);
        cell(&mut out, &soft.lag_ms.map_or_else(|| "–".into(), |ms| format!("{ms:+.0}")), "");
        optionals(&mut out, &[m.rest_ratio, m.bounded_ratio, m.frames_per_second]);
        out += "</tr>";
    }
    out + TAIL
}

/// Regions one by one: energy, spectral distance, peak and lag of our method.
pub fn regions(metrics: &Metrics) -> String {
    let Some(ours) = metrics.methods.get(OURS) else { return String::new() };
    let mut out = head(&["Region", "error, mm", "energy", "spectral distance, dB", "peak error, Hz", "lag, ms"]);
    for name in REPORTED {
        let Some(r) = ours.regions.get(name) else { continue };
        let _ = write!(out, "<tr><th scope=\"row\">{name}</th>");
        optionals(&mut out, &[r.mean_mm, r.energy_ratio, r.spectral_distance, r.peak_hz_error]);
        cell(&mut out, &r.lag_ms.map_or_else(|| "–".into(), |ms| format!("{ms:+.0}")), "");
        out += "</tr>";
    }
    out + TAIL
}

/// The same method driven by other pose channels; empty if there is only one.
pub fn channels(metrics: &Metrics) -> String {
    if names(metrics, is_channel).is_empty() {
        return String::new();
    }
    let first = if metrics.truth { "exact pose" } else { "fitted pose" };
    let others: &[(&str, &str)] =
        if metrics.truth { &[("fitted", "fitted pose"), ("rough", "rough pose")] } else { &[("rough", "rough pose")] };
    let mut columns = vec!["Soft ratio · energy", first];
    columns.extend(others.iter().map(|o| o.1));
    let mut out = head(&columns);
    let text = |m: Option<&MethodMetrics>| {
        let energy = m.and_then(|m| m.regions.get("soft")).and_then(|r| r.energy_ratio);
        let ratio = m.and_then(|m| m.soft_ratio);
        ratio.map_or_else(
            || "–".into(),
            |r| format!("{r:.2} <span class=\"pm\">· {}</span>", energy.map_or("–".into(), number)),
        )
    };
    for name in names(metrics, |n| !is_channel(n) && n != "body") {
        method_row(&mut out, name);
        cell(&mut out, &text(metrics.methods.get(name)), "");
        others.iter().for_each(|(c, _)| cell(&mut out, &text(metrics.methods.get(&format!("{name}/{c}"))), ""));
        out += "</tr>";
    }
    out + TAIL
}

/// PCA against the autoencoder.
pub fn subspace(metrics: &Metrics) -> String {
    let mut out = head(&[
        "Latent size",
        "PCA, mm",
        "autoencoder, mm",
        "change",
        "PCA against its input, mm",
        "autoencoder against its input, mm",
        "change",
    ]);
    let change = |a: Option<f64>, b: Option<f64>| {
        a.zip(b).map_or_else(|| "–".into(), |(a, b)| format!("{:+.1} %", (a / b - 1.0) * 100.0))
    };
    for (latent, m) in &metrics.subspace {
        let kept =
            if m.residual_kept == Some(false) { " <span class=\"chip missed\">validation kept PCA</span>" } else { "" };
        let _ = write!(out, "<tr><th scope=\"row\">{latent}{kept}</th>");
        optionals(&mut out, &[m.pca_mm, m.ae_mm]);
        cell(&mut out, &change(m.ae_mm, m.pca_mm), "");
        optionals(&mut out, &[m.scan_pca_mm, m.scan_ae_mm]);
        cell(&mut out, &change(m.scan_ae_mm, m.scan_pca_mm), "");
        out += "</tr>";
    }
    out + TAIL
}

/// What a linear probe tells from each motion descriptor.
pub fn leak(metrics: &Metrics) -> String {
    let mut out = head(&["Told right", "subject", "excess over chance", "motion", "excess over chance"]);
    for (name, m) in &metrics.leak {
        let words = match name.split_once('/') {
            Some((kind, "static")) => format!("{kind}, without velocities"),
            _ => name.clone(),
        };
        let _ = write!(out, "<tr><th scope=\"row\">{}</th>", escape(&words));
        let percent = |x: f64| format!("{:.0} %", 100.0 * x);
        for probe in [m.subject, m.motion] {
            let text = |figure: fn(&ProbeMetrics) -> f64| probe.as_ref().map_or("–".into(), |p| percent(figure(p)));
            cell(&mut out, &text(|p| p.accuracy), "");
            cell(&mut out, &text(ProbeMetrics::excess), "");
        }
        out += "</tr>";
    }
    out + TAIL
}

/// Free decays: the truth's frequency and damping ratio beside ours.
pub fn decays(metrics: &Metrics) -> String {
    let mut methods: Vec<&String> = metrics.decays.iter().flat_map(|d| d.methods.keys()).collect();
    methods.sort_by(|a, b| by_rank(a, b));
    methods.dedup();
    let labels: Vec<String> = methods.iter().map(|m| escape(&method_label(m))).collect();
    let mut columns = vec!["Frequency, Hz · damping ratio", "truth"];
    columns.extend(labels.iter().map(String::as_str));
    let mut out = head(&columns);
    for d in &metrics.decays {
        let _ = write!(out, "<tr><th scope=\"row\">{} · {}</th>", escape(&d.region), escape(&d.subject));
        let text = |f: &crate::DecayFigures| format!("{:.2} <span class=\"pm\">· {:.2}</span>", f.hz, f.damping_ratio);
        cell(&mut out, &text(&d.truth), "");
        methods.iter().for_each(|m| cell(&mut out, &d.methods.get(*m).map_or_else(|| "–".into(), text), ""));
        out += "</tr>";
    }
    out + TAIL
}

/// Takes one figure out of a fit's.
type FitFigure = fn(&FitMetrics) -> Option<f64>;

/// The fit, and both objectives side by side where both were run.
pub fn fit(metrics: &Metrics) -> String {
    let mut columns: Vec<(String, FitMetrics)> = Vec::new();
    columns.extend(metrics.fit.map(|f| ("this run".to_owned(), f)));
    columns.extend(metrics.fit_objectives.iter().map(|(n, f)| (format!("{n} objective"), *f)));
    let titles: Vec<String> = columns.iter().map(|c| escape(&c.0)).collect();
    let mut heads = vec!["Fit against truth"];
    heads.extend(titles.iter().map(String::as_str));
    let mut out = head(&heads);
    let rows: [(&str, FitFigure); 8] = [
        ("joint angle, median, degrees", |f| f.joint_deg_median),
        ("joint angle, 95th percentile, degrees", |f| f.joint_deg_p95),
        ("joint position, median, mm", |f| f.joint_mm_median),
        ("joint position, 95th percentile, mm", |f| f.joint_mm_p95),
        ("soft deltas, mean, mm", |f| f.delta_mm_mean),
        ("soft deltas, 95th percentile, mm", |f| f.delta_mm_p95),
        ("the scanner's own error, mean, mm", |f| f.scan_noise_mm),
        ("frames fitted in a second", |f| f.frames_per_second),
    ];
    for (label, part) in rows.iter().filter(|(_, part)| columns.iter().any(|c| part(&c.1).is_some())) {
        let _ = write!(out, "<tr><th scope=\"row\">{label}</th>");
        columns.iter().for_each(|c| optional(&mut out, part(&c.1)));
        out += "</tr>";
    }
    out + TAIL + &objectives(metrics)
}

/// A sentence on what the unposed objective gains (Casas-Otaduy fig. 3).
fn objectives(metrics: &Metrics) -> String {
    let delta = |n: &str| metrics.fit_objectives.get(n).and_then(|f| f.delta_mm_mean);
    let Some((posed, unposed)) = delta("posed").zip(delta("unposed")) else { return String::new() };
    let gain = (1.0 - unposed / posed) * 100.0;
    let text = if gain.abs() < 5.0 {
        format!(
            "The two objectives differ by {:.1} % in the deltas they recover: less than 5 %, so on these scans the choice hardly matters.",
            gain.abs()
        )
    } else if gain > 0.0 {
        format!(
            "Measured in the unposed space the deltas come out {gain:.0} % closer to the truth than with the posed objective."
        )
    } else {
        format!("On these scans the posed objective recovers the deltas {:.0} % better than the unposed one.", -gain)
    };
    format!("<p class=\"remark\">{text}</p>")
}

/// What was run, as pairs of a term and its value.
pub fn facts(facts: &[(String, String)]) -> String {
    if facts.is_empty() {
        return String::new();
    }
    let mut out = "<dl class=\"facts\">".to_owned();
    for (term, value) in facts {
        let _ = write!(out, "<div><dt>{}</dt><dd>{}</dd></div>", escape(term), escape(value));
    }
    out + "</dl>"
}

/// How long each stage took.
pub fn stages(stages: &[StageTime]) -> String {
    let total: f64 = stages.iter().map(|s| s.seconds).sum();
    if total <= 0.0 {
        return String::new();
    }
    let mut out = "<h3>Time by stage</h3><div class=\"stages\">".to_owned();
    for s in stages {
        let share = s.seconds / total * 100.0;
        let _ = write!(
            out,
            "<div class=\"stage\"><span>{}</span><span class=\"track\"><i style=\"width:{share:.2}%\"></i></span><span class=\"time\">{}</span></div>",
            escape(&s.name),
            duration(s.seconds)
        );
    }
    let _ = write!(
        out,
        "<div class=\"stage total\"><span>total</span><span></span><span class=\"time\">{}</span></div></div>",
        duration(total)
    );
    out
}
