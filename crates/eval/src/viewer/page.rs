//! The viewer's part of a page, and pages that stand alone.

use super::{View, ViewData};
use crate::report::escape;
use crate::{EvalError, Result};
use serde::Serialize;
use softtissue_body::Region;
use std::fmt::Write;

const CSS: &str = include_str!("../assets/style.css");
const CHARTS: &str = include_str!("../assets/charts.js");
const CANVAS: &str = include_str!("../assets/canvas.js");
const VIEWER: &str = include_str!("../assets/viewer.js");
const PAGE: &str = include_str!("../assets/page.js");
const VIEW: &str = include_str!("../assets/view.js");

/// Panes that stand side by side at most.
const MOST_PANES: usize = 4;

/// The markup of the viewer.
pub struct Stage<'a> {
    /// What it plays.
    pub data: &'a ViewData,
    /// Whether every pane can show every layer, and distances be measured from every layer.
    pub chooses: bool,
}

impl Stage<'_> {
    /// Panes, transport, chart and controls; what would have no effect is left out.
    pub fn html(&self) -> String {
        let layers: Vec<(&str, String)> = self.data.labels().map(|(key, label)| (key, escape(label))).collect();
        let (compares, panes) = (layers.len() > 1, layers.len().min(MOST_PANES));
        let mut out = format!("<div id=\"viewer\" class=\"viewer\"><div class=\"views panes-{panes}\">");
        for pane in 0..panes {
            self.pane(&mut out, &layers, pane);
        }
        out += "</div>";
        if self.data.plays() {
            out += "<div class=\"transport\"><button id=\"play\" type=\"button\" aria-label=\"Play or pause\">❚❚</button>\
                    <input id=\"time\" type=\"range\" min=\"0\" max=\"1\" value=\"0\" step=\"1\" aria-label=\"Time\">\
                    <output id=\"clock\">0.00 s</output></div>";
            if compares {
                out += "<div class=\"chart slim\" id=\"chart-play\"></div>";
            }
        }
        out += "<div class=\"controls\">";
        self.controls(&mut out, &layers);
        out += "<button id=\"reset\" type=\"button\">Reset view</button></div>";
        out += "<div class=\"under\"><span>Drag to turn, with Shift to move; wheel to come closer.";
        if panes > 1 {
            out += " The views move together.";
        }
        if compares && self.data.plays() {
            out += " Click the curve to go there.";
        }
        out += "</span>";
        if compares {
            out += "<span class=\"legend\"><span id=\"legend-name\"></span><span id=\"legend-low\">0</span>\
                    <i id=\"legend-ramp\"></i><span id=\"legend-high\"></span></span>";
        }
        out + "</div></div><p id=\"viewer-missing\" class=\"remark\" hidden></p>"
    }

    fn pane(&self, out: &mut String, layers: &[(&str, String)], pane: usize) {
        let (key, label) = &layers[pane];
        let name = if self.chooses && layers.len() > 1 {
            format!(
                "<select aria-label=\"What view {} shows\">{}</select>",
                pane + 1,
                options(layers.iter().enumerate().map(|(i, l)| (i, l.1.as_str())), pane)
            )
        } else {
            format!("<b>{label}</b>")
        };
        let _ = write!(
            out,
            "<figure><canvas id=\"view-{key}\" aria-label=\"{label}, playing in 3D\"></canvas>\
             <figcaption>{name}<span class=\"readout\"></span></figcaption></figure>"
        );
    }

    fn controls(&self, out: &mut String, layers: &[(&str, String)]) {
        let clips: Vec<String> = self.data.clip_names().map(escape).collect();
        if clips.len() > 1 {
            select(out, "Clip", "clip", &options(clips.iter().map(String::as_str).enumerate(), 0));
        }
        if self.data.plays() {
            const SPEEDS: [(&str, &str); 4] = [("0.1", "1/10"), ("0.25", "1/4"), ("0.5", "1/2"), ("1", "1")];
            select(out, "Speed", "speed", &options(SPEEDS.into_iter(), "1"));
        }
        if layers.len() < 2 {
            return;
        }
        const COLOURS: [(&str, &str); 3] = [("error", "distance"), ("displacement", "displacement"), ("plain", "none")];
        let first = if self.data.reference().is_some() { "error" } else { "displacement" };
        select(out, "Colour", "colour", &options(COLOURS.into_iter(), first));
        if self.chooses {
            let from = layers.iter().enumerate().map(|(i, l)| (i, l.1.as_str()));
            let chosen = self.data.reference().unwrap_or(layers.len() - 1);
            select(out, "from", "against", &options(from, chosen));
            let scales = std::iter::once(("", "automatic")).chain(SCALES.map(|mm| (mm, mm)));
            select(out, "Scale, mm", "scale", &options(scales, ""));
        }
        if self.data.has_regions() {
            let named = Region::ALL.map(|r| (r.name(), r.name().replace('-', " ")));
            let parts = [("soft", "soft parts"), ("all", "all")].into_iter();
            let parts = parts.chain(named.iter().map(|(key, label)| (*key, label.as_str())));
            select(out, "Region", "region", &options(parts, "soft"));
        }
        *out += "<label>Exaggerate <input id=\"gain\" type=\"range\" min=\"1\" max=\"5\" value=\"1\" step=\"0.5\">\
                 <output id=\"gain-value\">× 1</output></label>";
    }
}

/// Ends of the colour scale to choose from, millimetres.
const SCALES: [&str; 8] = ["1", "2", "5", "10", "20", "30", "50", "100"];

fn select(out: &mut String, label: &str, id: &str, options: &str) {
    let _ = write!(out, "<label>{label} <select id=\"{id}\">{options}</select></label>");
}

/// Options of a chooser; the labels are safe already.
fn options<'a, K: std::fmt::Display + PartialEq>(entries: impl Iterator<Item = (K, &'a str)>, chosen: K) -> String {
    let mut out = String::new();
    for (key, label) in entries {
        let selected = if key == chosen { " selected" } else { "" };
        let _ = write!(out, "<option value=\"{key}\"{selected}>{label}</option>");
    }
    out
}

/// A page that stands alone: `body` between its tags, `data` for `script`, which runs after
/// what draws charts and the viewer.
pub fn document(title: &str, body: &str, data: &impl Serialize, script: &str) -> Result<String> {
    let json = serde_json::to_string(data)
        .map_err(|e| EvalError::Refused(format!("the page's data cannot be written: {e}")))?
        // no tag can end inside a string
        .replace('<', "\\u003c");
    let mut out = String::with_capacity(json.len() + body.len() + (1 << 17));
    let _ = write!(
        out,
        "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>{title}</title>\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:\">\
         <link rel=\"icon\" href=\"data:,\"><style>{CSS}</style></head><body>{body}\
         <footer>Made by softtissue. This file stands alone: it loads nothing.</footer>\
         <script type=\"application/json\" id=\"data\">{json}</script><script>{CHARTS}{CANVAS}{VIEWER}{PAGE}{script}</script></body></html>"
    );
    Ok(out)
}

/// A page that shows a view and nothing else.
pub fn html(view: &View) -> Result<String> {
    let data = ViewData::new(&view.surface, view.clips, view.reference, usize::MAX);
    let title = escape(view.title);
    let mut body = format!(
        "<header class=\"compact\"><div class=\"bar\"><span class=\"mark\">softtissue</span><nav></nav>\
         <button id=\"theme\" type=\"button\" aria-label=\"Switch between light and dark\">◐</button></div>\
         <div class=\"title\"><h1>{title}</h1><p>{}</p></div></header><main>{}",
        escape(view.about),
        Stage { data: &data, chooses: true }.html()
    );
    for note in view.notes {
        let _ = write!(body, "<p class=\"remark\">{}</p>", escape(note));
    }
    body += "</main>";
    document(&format!("{title} – softtissue"), &body, &data, VIEW)
}
