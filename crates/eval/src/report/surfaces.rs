//! The report of a method that predicts surfaces: the paper's table, its curves over the frames of a rollout, and how the
//! surfaces move.

use super::plain::Table;
use super::tables::{self, TAIL, cell, head};
use super::text::{escape, method_label};
use super::{StageTime, TrainingCurve};
use crate::Result;
use crate::surfaces::{SurfaceFigures, SurfaceMetrics};
use crate::viewer::{Stage, Surface, ViewClip, ViewData, document};
use serde::Serialize;
use softtissue_store::write_atomic;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

const PAGE: &str = include_str!("../assets/surfaces.js");
/// Packed clips may fill this many bytes of the file.
const PLAYBACK_BYTES: usize = 22 << 20;
const DISTANCE: &str = "Scan-to-prediction distance, mm";
const VOLUME: &str = "Mean squared error of volume change";

/// What the report is made of; what is empty is left out.
#[derive(Clone, Copy)]
pub struct SurfaceReport<'a> {
    /// Name of the run.
    pub title: &'a str,
    /// All figures.
    pub metrics: &'a SurfaceMetrics,
    /// What was run, as pairs of a term and its value.
    pub facts: &'a [(String, String)],
    /// How long it took.
    pub stages: &'a [StageTime],
    /// How training went.
    pub training: &'a [TrainingCurve],
    /// The mesh that the surfaces are drawn over.
    pub surface: Surface<'a>,
    /// Clips to play.
    pub playback: &'a [ViewClip],
}

/// A figure of table 1 after so many frames of rollout.
type Figure = fn(&SurfaceFigures, usize) -> Option<f64>;
/// A column of the table about motion.
type Moves = fn(&SurfaceMetrics, &str) -> Option<f64>;

const FIGURES: [(&str, Figure, usize); 2] = [
    (DISTANCE, |f, n| f.rollout.distance_mm.get(&n).copied(), 3),
    (VOLUME, |f, n| f.rollout.volume_change.get(&n).copied(), 5),
];

/// How surfaces move, a column each.
const MOTION: [(&str, Moves); 7] = [
    ("energy, interpolation", |m, r| m.interpolation.get(r)?.rollout.height_energy),
    ("energy, extrapolation", |m, r| m.extrapolation.get(r)?.rollout.height_energy),
    ("spectral dB, interpolation", |m, r| m.interpolation.get(r)?.spectral_db),
    ("spectral dB, extrapolation", |m, r| m.extrapolation.get(r)?.spectral_db),
    ("long rollout", |m, r| Some(m.cycles.get(r)?.bounded_ratio)),
    ("its growth", |m, r| Some(m.cycles.get(r)?.growth)),
    ("its ms a frame", |m, r| Some(m.cycles.get(r)?.frame_ms)),
];

/// The tables as text: the paper's table 1, then what standing still does not improve.
pub fn tables(metrics: &SurfaceMetrics) -> String {
    let rows = metrics.rows();
    let rollouts = |figures: &BTreeMap<String, SurfaceFigures>| figures.values().map(|f| f.rollout.rollouts).max();
    let counts: Vec<String> = metrics.sets().map(|(name, f)| format!("{name} {}", rollouts(f).unwrap_or(0))).collect();
    let mut parts = vec![format!(
        "{}, {} poses, surfaces from {} cells; rollouts: {}.\n",
        metrics.subject,
        metrics.poses,
        metrics.grid,
        counts.join(", ")
    )];
    for (title, figure, digits) in FIGURES {
        let lengths = lengths(metrics, figure);
        let columns: Vec<String> = lengths.iter().map(ToString::to_string).collect();
        let mut heads = vec!["after frames of rollout"];
        heads.extend(columns.iter().map(String::as_str));
        let mut table = Table::new(title, &heads);
        for (set, figures) in metrics.sets() {
            table.heading(&format!("{set} set"));
            for name in rows.iter().filter(|n| figures.contains_key(**n)) {
                let cell = |n: &usize| figure(&figures[*name], *n).map(|x| format!("{x:.digits$}"));
                table.row(name, lengths.iter().map(cell));
            }
        }
        parts.push(table.finish());
    }
    parts.extend(lost(metrics).map(|sentence| sentence + "\n"));
    let shown: Vec<_> = MOTION.iter().filter(|(_, of)| rows.iter().any(|r| of(metrics, r).is_some())).collect();
    let mut heads = vec!["method"];
    heads.extend(shown.iter().map(|(name, _)| *name));
    let mut table =
        Table::new("How heights move: 1 is the scans' energy, 0 stands still; 0 dB is their spectrum.", &heads);
    for name in &rows {
        table.row(name, shown.iter().map(|(_, of)| of(metrics, name).map(|x| format!("{x:.2}"))));
    }
    parts.push(table.finish());
    parts.extend(clip_means(metrics));
    parts.into_iter().filter(|p| !p.is_empty()).collect::<Vec<_>>().join("\n")
}

/// Which rows had predictions without a surface, if any had.
fn lost(metrics: &SurfaceMetrics) -> Option<String> {
    let mut rows = Vec::new();
    for (set, figures) in metrics.sets() {
        let of_set = figures.iter().filter(|(_, f)| f.rollout.lost > 0);
        rows.extend(of_set.map(|(name, f)| format!("{name} {} of the {set} set", f.rollout.lost)));
    }
    let frames = rows.join(", ");
    (!rows.is_empty())
        .then(|| format!("Frames whose predicted surface was nowhere, so that no distance has them: {frames}."))
}

/// Frames of rollout that have a figure.
fn lengths(metrics: &SurfaceMetrics, figure: Figure) -> Vec<usize> {
    let rows: Vec<&SurfaceFigures> = metrics.sets().flat_map(|(_, rows)| rows.values()).collect();
    let all: BTreeSet<usize> = rows.iter().flat_map(|f| f.rollout.distance_mm.keys().copied()).collect();
    all.into_iter().filter(|n| rows.iter().any(|f| figure(f, *n).is_some())).collect()
}

/// The clip of fig. 7 in a number a row.
fn clip_means(metrics: &SurfaceMetrics) -> Option<String> {
    let curves = metrics.over_time.as_ref()?;
    let title = format!("{} in one rollout from frame {} on, mean over frames (fig. 7)", curves.clip, curves.start);
    let mut table = Table::new(&title, &["method", DISTANCE, "frames", "ms a frame"]);
    for name in metrics.rows() {
        let Some(curve) = curves.distance_mm.get(name) else { continue };
        let measured: Vec<f64> = curve.iter().flatten().copied().collect();
        let mean = measured.iter().sum::<f64>() / measured.len().max(1) as f64;
        let time = curves.frame_ms.get(name).map(|ms| format!("{ms:.1}"));
        table.row(name, [(!measured.is_empty()).then(|| format!("{mean:.3}")), Some(measured.len().to_string()), time]);
    }
    Some(table.finish())
}

#[derive(Serialize)]
struct Chart {
    name: String,
    x: &'static str,
    unit: &'static str,
    curves: Vec<(String, Vec<[f64; 2]>)>,
}

#[derive(Serialize)]
struct PageData {
    rows: Vec<String>,
    labels: BTreeMap<String, String>,
    rollouts: Vec<Chart>,
    time: Vec<Chart>,
    training: Vec<Chart>,
    view: Option<ViewData>,
}

/// Writes the report, atomically.
///
/// # Errors
/// The disk.
pub fn write_surfaces(report: &SurfaceReport, path: &Path) -> Result<()> {
    let page = html(report)?;
    Ok(write_atomic(path, |w| w.write_all(page.as_bytes()))?)
}

fn html(report: &SurfaceReport) -> Result<String> {
    let m = report.metrics;
    let data = page_data(report);
    let title = escape(report.title);
    let mut body = format!(
        "<header><div class=\"bar\"><span class=\"mark\">softtissue</span><nav></nav>\
         <button id=\"theme\" type=\"button\" aria-label=\"Switch between light and dark\">◐</button></div>\
         <div class=\"title\"><h1>{title}</h1><p>AutoAvatar of {}, {} poses, held against raw scans; surfaces from {} cells.\
         </p></div></header><main>",
        escape(&m.subject),
        escape(&m.poses),
        m.grid
    );
    if let Some(view) = &data.view {
        let _ = write!(
            body,
            "<section id=\"view\"><h2>See it move</h2>{VIEW_NOTE}{}",
            Stage { data: view, chooses: true }.html()
        );
        body += "</section>";
    }
    body += "<section id=\"errors\"><h2>Errors</h2><p>Rollouts begin at every twentieth frame from true heights and are judged \
             after 1 to 30 frames (table 1 of the paper). Bold: the least.</p>\
             <div class=\"chart pick\" id=\"chart-rollouts\"></div>";
    for (name, figure, digits) in FIGURES {
        for (set, figures) in m.sets() {
            let _ = write!(body, "<h3>{name}, {set} set</h3>{}", rollout_table(m, figures, figure, digits));
        }
    }
    if let Some(sentence) = lost(m) {
        let _ = write!(body, "<p>{}</p>", escape(&sentence));
    }
    if !data.time.is_empty() {
        body += "<h3>One rollout through a whole clip</h3><div class=\"chart pick\" id=\"chart-time\"></div>";
    }
    body += "</section><section id=\"motion\"><h2>Motion</h2><p>A distance alone rewards standing still. Energy: rms change of \
             heights over that of the scans. Spectral distance: of regional changes of height, 0.75 to 15 Hz. Long rollout: the \
             greatest excursion over a motion played over and over, and whether it grows.</p>";
    body += &motion_table(m);
    body += "</section>";
    let run = tables::facts(report.facts) + &tables::stages(report.stages);
    if !run.is_empty() || !data.training.is_empty() {
        let _ = write!(body, "<section id=\"run\"><h2>Run</h2>{run}");
        if !data.training.is_empty() {
            body += "<h3>Training</h3><div class=\"chart pick\" id=\"chart-training\"></div>";
        }
        body += "</section>";
    }
    body += "</main>";
    document(&format!("{title} – softtissue report"), &body, &data, PAGE)
}

const VIEW_NOTE: &str = "<p>The body's mesh, moved along its normals by the heights of each surface: the surfaces themselves have \
                         other triangles in every frame. Rollouts begin once, from the scans before the first frame shown.</p>";

fn rollout_table(
    metrics: &SurfaceMetrics,
    figures: &BTreeMap<String, SurfaceFigures>,
    figure: Figure,
    digits: usize,
) -> String {
    let lengths = lengths(metrics, figure);
    let names: Vec<String> = lengths.iter().map(|n| format!("{n}")).collect();
    let mut columns = vec!["after frames"];
    columns.extend(names.iter().map(String::as_str));
    let least = |n: usize| figures.values().filter_map(|f| figure(f, n)).fold(f64::INFINITY, f64::min);
    let mut out = head(&columns);
    for name in metrics.rows() {
        let Some(row) = figures.get(name) else { continue };
        let _ = write!(out, "<tr><th scope=\"row\">{}</th>", escape(&method_label(name)));
        for n in &lengths {
            match figure(row, *n) {
                Some(x) => cell(&mut out, &format!("{x:.digits$}"), if x <= least(*n) { "best" } else { "" }),
                None => cell(&mut out, "–", "none"),
            }
        }
        out += "</tr>";
    }
    out + TAIL
}

fn motion_table(metrics: &SurfaceMetrics) -> String {
    let mut columns = vec!["method"];
    columns.extend(MOTION.iter().map(|(name, _)| *name));
    let mut out = head(&columns);
    for name in metrics.rows() {
        let _ = write!(out, "<tr><th scope=\"row\">{}</th>", escape(&method_label(name)));
        for (_, of) in MOTION {
            match of(metrics, name) {
                Some(x) => cell(&mut out, &format!("{x:.2}"), ""),
                None => cell(&mut out, "–", "none"),
            }
        }
        out += "</tr>";
    }
    out + TAIL
}

fn page_data(report: &SurfaceReport) -> PageData {
    let m = report.metrics;
    let rows: Vec<String> = m.rows().into_iter().map(ToOwned::to_owned).collect();
    let chart = |set: &str, figures: &BTreeMap<String, SurfaceFigures>, (name, figure, _): (&str, Figure, usize)| {
        let points = |row: &String| -> Option<(String, Vec<[f64; 2]>)> {
            let row_figures = figures.get(row)?;
            let at = |n: &usize| Some([*n as f64, figure(row_figures, *n)?]);
            Some((row.clone(), lengths(m, figure).iter().filter_map(at).collect()))
        };
        let unit = if name == DISTANCE { "mm" } else { "" };
        let curves = rows.iter().filter_map(points).collect();
        Chart { name: format!("{name}, {set} set"), x: "frames of rollout", unit, curves }
    };
    let rollouts = FIGURES.iter().flat_map(|f| m.sets().map(|(set, figures)| chart(set, figures, *f))).collect();
    let time = m.over_time.iter().filter(|c| !c.distance_mm.is_empty()).map(|clip| {
        let curve = |name: &String| {
            let seconds = |t: usize| (clip.start + t) as f64 / f64::from(clip.fps);
            let mm = clip.distance_mm.get(name)?;
            let points = mm.iter().enumerate().filter_map(|(t, mm)| Some([seconds(t), (*mm)?])).collect();
            Some((name.clone(), points))
        };
        let curves = rows.iter().filter_map(curve).collect();
        Chart { name: format!("{DISTANCE}, {}", clip.clip), x: "seconds", unit: "mm", curves }
    });
    let mut training: Vec<Chart> = Vec::new();
    for curve in report.training {
        let line = (curve.name.clone(), curve.points.clone());
        match training.iter_mut().find(|c| c.name == curve.stage) {
            Some(chart) => chart.curves.push(line),
            None => training.push(Chart { name: curve.stage.clone(), x: "step", unit: "", curves: vec![line] }),
        }
    }
    let view = (!report.playback.is_empty())
        .then(|| ViewData::new(&report.surface, report.playback, Some("reference"), PLAYBACK_BYTES));
    let labels = rows.iter().map(|n| (n.clone(), method_label(n))).collect();
    PageData { time: time.collect(), rows, labels, rollouts, training, view }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surfaces::{CycleFigures, STILL, SurfaceCurves};
    use softtissue_implicit::RolloutFigures;

    fn metrics() -> SurfaceMetrics {
        let mut m = SurfaceMetrics::new("s00", "fitted", 64);
        let row = |mm: f64, db: Option<f64>| SurfaceFigures {
            rollout: RolloutFigures {
                distance_mm: [(1, mm), (16, 2.0 * mm)].into(),
                volume_change: [(16, 0.01 * mm)].into(),
                height_energy: Some(0.5),
                rollouts: 3,
                lost: u32::from(mm == 3.5),
            },
            spectral_db: db,
        };
        for (name, mm) in [("autoregressive", 1.25), ("pose", 3.5), (STILL, 1.5)] {
            m.extrapolation.insert(name.into(), row(mm, Some(7.25)));
        }
        m.interpolation.insert("pose".into(), row(2.5, None));
        let cycle =
            CycleFigures { clip: "s00/hips.0".into(), frames: 3600, bounded_ratio: 1.1, growth: 0.9, frame_ms: 20.0 };
        m.cycles.insert("autoregressive".into(), cycle);
        m.over_time = Some(SurfaceCurves {
            clip: "s00/<hop>.0".into(),
            fps: 60.0,
            start: 3,
            distance_mm: [("pose".to_owned(), vec![Some(1.0), None, Some(2.0)])].into(),
            frame_ms: [("pose".to_owned(), 5.25)].into(),
        });
        m
    }

    fn cells<'a>(text: &'a str, start: &str) -> Vec<Vec<&'a str>> {
        let lines = text.lines().filter(|l| l.starts_with(start));
        lines.map(|l| l.split("  ").map(str::trim).filter(|c| !c.is_empty()).collect()).collect()
    }

    #[test]
    fn the_text_has_the_papers_layout() {
        let text = tables(&metrics());
        assert!(
            text.starts_with(
                "s00, fitted poses, surfaces from 64 cells; rollouts: interpolation 3, extrapolation 3.\n"
            )
        );
        let pose = cells(&text, "pose ");
        assert_eq!(pose[0], ["pose", "2.500", "5.000"], "{text}");
        assert_eq!(pose[1], ["pose", "3.500", "7.000"], "{text}");
        assert_eq!(pose[2], ["pose", "0.02500"], "{text}");
        assert_eq!(pose[4], ["pose", "0.50", "0.50", "7.25", "-", "-", "-"], "{text}");
        assert_eq!(pose[5], ["pose", "1.500", "2", "5.2"], "{text}");
        assert!(text.contains("no distance has them: pose 1 of the extrapolation set.\n"), "{text}");
        let own = cells(&text, "autoregressive");
        assert_eq!(own[2], ["autoregressive", "-", "0.50", "7.25", "1.10", "0.90", "20.00"], "{text}");
        let order = |row: &str| text.lines().position(|l| l.starts_with(row)).expect(row);
        assert!(order("interpolation set") < order("extrapolation set") && order(STILL) < order("autoregressive"));
    }

    #[test]
    fn the_page_has_tables_charts_and_nothing_that_breaks_out() {
        let m = metrics();
        let report = SurfaceReport {
            title: "a <run>",
            metrics: &m,
            facts: &[("seed".into(), "1".into())],
            stages: &[],
            training: &[],
            surface: Surface { faces: &[[0, 1, 2]], regions: None },
            playback: &[],
        };
        let page = html(&report).unwrap();
        assert!(!page.contains("<run>") && !page.contains("<hop>"));
        assert!(page.contains("standing still") && page.contains("<td class=\"best\">1.250</td>"), "least is bold");
        assert!(page.contains("id=\"chart-rollouts\"") && page.contains("id=\"chart-time\""));
        assert!(!page.contains("id=\"chart-training\"") && page.contains("pose 1 of the extrapolation set.</p>"));
        assert_eq!(page.matches("Mean squared error of volume change, ").count(), 4, "a table and a chart a set");
    }
}
