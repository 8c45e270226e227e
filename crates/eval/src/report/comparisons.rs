//! Tables that set people, sequences and times of methods beside each other.

use super::tables::{TAIL, cell, head, method_row, optional};
use super::text::{by_rank, escape, method_label, thousands};
use crate::Metrics;
use std::fmt::Write;

/// Soft ratio of each person, one column a person from the heaviest to the lightest.
pub fn people(metrics: &Metrics) -> String {
    let mut people: Vec<_> = metrics.people.iter().collect();
    people.sort_by(|a, b| {
        let beta = |p: &crate::PersonMetrics| p.beta_1.unwrap_or(f64::INFINITY);
        beta(a.1).total_cmp(&beta(b.1))
    });
    let title = |(name, p): &(&String, &crate::PersonMetrics)| {
        let beta = p.beta_1.map_or(String::new(), |b| format!(" <span class=\"pm\">{b:+.1}</span>"));
        escape(name) + &beta
    };
    let titles: Vec<String> = people.iter().map(title).collect();
    let mut columns = vec!["Soft ratio by person, beta 1"];
    columns.extend(titles.iter().map(String::as_str));
    let mut out = head(&columns);
    let mut methods: Vec<&String> = metrics.people.values().flat_map(|p| p.methods.keys()).collect();
    methods.sort_by(|a, b| by_rank(a, b));
    methods.dedup();
    for name in methods.into_iter().filter(|m| *m != "body") {
        method_row(&mut out, name);
        people.iter().for_each(|(_, p)| optional(&mut out, p.methods.get(name).and_then(|f| f.soft_ratio)));
        out += "</tr>";
    }
    out + TAIL
}

/// What a protocol left out, clip by clip: the run's method beside the body alone; empty for held-out clips.
pub fn sequences(metrics: &Metrics) -> String {
    let Some(method) = metrics.method.as_deref().filter(|_| metrics.protocol != "held-out") else {
        return String::new();
    };
    let label = escape(&method_label(method));
    let columns = ["body alone", label.as_str(), "belly and chest: body alone", label.as_str(), "soft ratio"];
    let mut out = head(&[&["Left out: error, mm"], &columns[..]].concat());
    for clip in &metrics.clips {
        let fold = clip.fold.as_deref().map_or(String::new(), |f| format!("{} · ", escape(f)));
        let _ = write!(out, "<tr><th scope=\"row\">{fold}{}</th>", escape(&clip.id().to_string()));
        for region in ["all", "belly-chest"] {
            for name in ["body", method] {
                let error = clip.methods.get(name).and_then(|m| m.regions.get(region));
                match error.and_then(|r| r.mean_mm.zip(r.frame_std_mm)) {
                    Some((mean, std)) => cell(&mut out, &format!("{mean:.2}<span class=\"pm\">±{std:.2}</span>"), ""),
                    None => cell(&mut out, "–", "none"),
                }
            }
        }
        optional(&mut out, clip.methods.get(method).and_then(|m| m.soft_ratio));
        out += "</tr>";
    }
    out + TAIL
}

/// Parts that some method has, in the order in which a frame runs through them.
pub fn timed_parts(metrics: &Metrics) -> Vec<&str> {
    const ORDER: [&str; 6] = ["skinning", "descriptor", "encoder", "regressor", "decoder", "feedback"];
    let found = |part: &&str| metrics.timing.values().any(|t| t.part(part).is_some());
    ORDER.into_iter().filter(found).collect()
}

/// Time of a frame, part by part.
pub fn timing(metrics: &Metrics) -> String {
    let parts = timed_parts(metrics);
    let mut columns = vec!["Milliseconds a frame"];
    columns.extend(&parts);
    columns.extend(["whole", "95th percentile"]);
    let mut out = format!(
        "<p>From a pose to posed vertices, {} of them, on one core; medians over some hundred frames. Encoder: of the pose. \
         Feedback: what was regressed, encoded for the next frame. Without a decoder the regressor gives all vertices.</p>",
        thousands(metrics.data.vertices as i64)
    );
    out += &head(&columns);
    let mut names: Vec<&String> = metrics.timing.keys().collect();
    names.sort_by(|a, b| by_rank(a, b));
    for name in names {
        let t = &metrics.timing[name];
        method_row(&mut out, name);
        parts.iter().for_each(|p| optional(&mut out, t.part(p)));
        optional(&mut out, Some(t.whole_ms));
        optional(&mut out, Some(t.whole_p95_ms));
        out += "</tr>";
    }
    out + TAIL
}
