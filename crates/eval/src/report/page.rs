//! The page as a whole.

use super::charts::PageData;
use super::text::{escape, thousands};
use super::{ReportInput, comparisons, tables};
use crate::Result;
use crate::viewer::{Stage, document};
use std::fmt::Write;

const PAGE: &str = include_str!("../assets/report.js");
const WORDS: &str = include_str!("../assets/words.html");

pub fn html(input: &ReportInput) -> Result<String> {
    let data = PageData::new(input);
    let title = escape(input.title);
    let mut body = header(input, &title);
    body += "<main>";
    body += &tables::headline(input.metrics);
    for s in sections(input, &data) {
        let _ = write!(body, "<section id=\"{}\"><h2>{}</h2>{}</section>", s.id, s.title, s.body);
    }
    body += "</main>";
    document(&format!("{title} – softtissue report"), &body, &data, PAGE)
}

fn header(input: &ReportInput, title: &str) -> String {
    let m = input.metrics;
    let count =
        |n: usize, one: &str, many: &str| format!("{} {}", thousands(n as i64), if n == 1 { one } else { many });
    let reference = if m.truth { "held against the simulator's truth" } else { "held against the scans" };
    let mut links = String::new();
    for (id, name, shown) in nav(input) {
        if shown {
            let _ = write!(links, "<a href=\"#{id}\">{name}</a>");
        }
    }
    format!(
        "<header><div class=\"bar\"><span class=\"mark\">softtissue</span><nav>{links}</nav>\
         <button id=\"theme\" type=\"button\" aria-label=\"Switch between light and dark\">◐</button></div>\
         <div class=\"title\"><h1>{title}</h1><p>{} of {}, {} of {} vertices, {reference}. Protocol: {}. Seed {}.</p></div></header>",
        count(m.clips.len(), "clip", "clips"),
        count(m.data.subjects.len(), "subject", "subjects"),
        count(m.data.frames, "frame", "frames"),
        thousands(m.data.vertices as i64),
        escape(&m.protocol.replace('-', " ")),
        m.seed,
    )
}

const LEAK: &str = "<p>How well a linear probe tells from the motion descriptor who moves, on motions that it has not seen, \
                    and what motion it is. The learned pose should give away less of the person and keep the motion. Excess \
                    over chance: 0 % guesses, 100 % knows.</p>";

struct Section {
    id: &'static str,
    title: &'static str,
    body: String,
}

/// Which sections there are, for the bar at the top.
fn nav(input: &ReportInput) -> [(&'static str, &'static str, bool); 9] {
    let m = input.metrics;
    [
        ("view", "See it move", !input.playback.is_empty()),
        ("gates", "Acceptance", !m.gates.is_empty()),
        ("errors", "Errors", !m.methods.is_empty()),
        ("motion", "Motion", !m.methods.is_empty()),
        ("subspace", "Subspace", !m.subspace.is_empty()),
        ("leak", "Leak", !m.leak.is_empty()),
        ("timing", "Time", !m.timing.is_empty()),
        ("fit", "Fit", m.fit.is_some() || !m.fit_objectives.is_empty()),
        ("run", "Run", !input.facts.is_empty() || !input.stages.is_empty() || !input.training.is_empty()),
    ]
}

fn sections(input: &ReportInput, data: &PageData) -> Vec<Section> {
    let m = input.metrics;
    let mut sections: Vec<Section> = Vec::new();
    for (id, title, shown) in nav(input) {
        if !shown {
            continue;
        }
        let body = match id {
            "view" => view(input, data),
            "gates" => tables::gates(m),
            "errors" => errors(input),
            "motion" => motion(input),
            "subspace" => subspace(input),
            "leak" => LEAK.to_owned() + &tables::leak(m),
            "timing" => comparisons::timing(m) + "<div class=\"chart\" id=\"chart-timing\"></div>",
            "fit" => tables::fit(m),
            _ => {
                tables::facts(input.facts)
                    + &tables::stages(input.stages)
                    + if input.training.is_empty() {
                        ""
                    } else {
                        "<h3>Training</h3><div class=\"chart pick\" id=\"chart-training\"></div>"
                    }
            }
        };
        sections.push(Section { id, title, body });
    }
    sections.push(Section { id: "words", title: "What the figures mean", body: WORDS.to_owned() });
    sections
}

fn view(input: &ReportInput, data: &PageData) -> String {
    let Some(view) = &data.view else { return String::new() };
    let note = match input.playback.len() - view.clip_names().count() {
        0 => String::new(),
        n => format!("<p class=\"remark\">{n} more would have made this file too large and were left out.</p>"),
    };
    Stage { data: view, chooses: false }.html() + &note
}

fn errors(input: &ReportInput) -> String {
    let m = input.metrics;
    let against = if m.truth { "the true deltas" } else { "the scans' deltas" };
    let mut out = format!(
        "<p>Distance of predicted from reference displacement of the unposed skin, mean ± standard deviation over vertices and frames, \
         against {against}. The methods roll out freely from rest; nothing of these clips was seen in training. Bold: the least.</p>"
    );
    out += &tables::errors(m, false);
    out += "<div class=\"two\"><div class=\"chart\" id=\"chart-soft\"></div><div class=\"chart\" id=\"chart-energy\"></div></div>";
    if m.truth {
        out += "<details><summary>The same against the scans' deltas, scanner noise included</summary>";
        out += &tables::errors(m, true);
        out += "</details>";
    }
    if input.tally.is_some_and(|t| !t.clips.is_empty()) {
        out += "<h3>Error over time</h3><div class=\"chart pick\" id=\"chart-time\"></div>";
    }
    let sequences = comparisons::sequences(m);
    if !sequences.is_empty() {
        out += "<h3>What was left out</h3><p>Mean ± standard deviation over frames of each frame's mean error.</p>";
        out += &sequences;
    }
    if m.people.len() > 1 {
        out += "<h3>Error by shape</h3><p>The same, person by person: beta 1 falls as mass rises.</p>\
                <div class=\"chart pick\" id=\"chart-people\"></div>";
        out += &comparisons::people(m);
    }
    if !m.clips.is_empty() {
        out += "<details><summary>Clip by clip</summary>";
        out += &tables::clips(m);
        out += "</details>";
    }
    let channels = tables::channels(m);
    if !channels.is_empty() {
        out += "<h3>Other sources of pose</h3><p>The same models, driven by the motion fitted to the test scan and by a rough one with \
                smooth errors of a degree or two.</p>";
        out += &channels;
    }
    out
}

fn motion(input: &ReportInput) -> String {
    let m = input.metrics;
    let mut out = "<p>An error alone rewards standing still. These figures say whether the flesh moves as much, as fast and as long as it should.</p>".to_owned();
    out += &tables::motion(m);
    if input.tally.is_some_and(|t| t.clips.iter().any(|c| !c.spectra.is_empty())) {
        out += "<h3>Spectra of regional means</h3><div class=\"chart pick\" id=\"chart-spectra\"></div>";
    }
    let regions = tables::regions(m);
    if !regions.is_empty() {
        out += "<details><summary>softtissue region by region</summary>";
        out += &regions;
        out += "</details>";
    }
    if !m.shape_response.is_empty() {
        out += "<h3>Speed against body mass</h3><p>The same motion on other bodies: beta 1 falls as mass rises.</p>\
                <div class=\"chart\" id=\"chart-shapes\"></div>";
    }
    if !m.bmi_response.is_empty() {
        out += "<h3>Body mass at one height</h3><p>The same motion on bodies of one height and another body mass index.</p>\
                <div class=\"chart pick\" id=\"chart-bmi\"></div>";
    }
    if !input.decays.is_empty() {
        out += "<h3>Free decay after landing</h3><p>The motion has ended; what is left is the flesh's own ringing.</p>\
                <div class=\"chart pick\" id=\"chart-decay\"></div>";
    }
    if !m.decays.is_empty() {
        out += &tables::decays(m);
    }
    out
}

fn subspace(input: &ReportInput) -> String {
    let truth = input.metrics.subspace.values().any(|s| s.pca_mm.is_some());
    let lead = if truth {
        "Scan deltas in, error against the true deltas, mean over all vertices."
    } else {
        "Scan deltas in, error against them, mean over all vertices."
    };
    let mut out = format!(
        "<p>{lead} Both see the same few numbers a frame.</p><div class=\"chart\" id=\"chart-subspace\"></div>{}",
        tables::subspace(input.metrics)
    );
    if input.metrics.over_time.iter().any(|c| !c.subspace.is_empty()) {
        out += "<h3>Over time</h3><div class=\"chart pick\" id=\"chart-subspace-time\"></div>";
    }
    if input.metrics.subspace_by_subject.len() > 1 {
        out += "<h3>By shape</h3><div class=\"chart\" id=\"chart-subspace-people\"></div>";
    }
    out
}
