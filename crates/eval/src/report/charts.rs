//! The data behind charts and the 3D view, as JSON for the page's script.

use super::ReportInput;
use super::text::{by_rank, is_channel, method_label};
use crate::MOVING;
use crate::measures::Spectrum;
use crate::viewer::{Surface, ViewData};
use serde::Serialize;
use std::collections::BTreeMap;

/// Packed clips may fill this many bytes of the file.
const PLAYBACK_BYTES: usize = 22 << 20;

#[derive(Serialize)]
pub struct PageData {
    labels: BTreeMap<String, String>,
    methods: Vec<String>,
    bars: Vec<MethodBar>,
    over_time: Vec<OverTime>,
    subspace: Vec<SubspaceRow>,
    spectra: Vec<RegionCurves>,
    decays: Vec<RegionCurves>,
    training: Vec<RegionCurves>,
    shapes: Vec<(String, Vec<[f64; 2]>)>,
    bmi: Vec<RegionCurves>,
    people: Vec<RegionCurves>,
    subspace_time: Vec<RegionCurves>,
    subspace_people: Vec<(String, Vec<[f64; 2]>)>,
    timing: Vec<(String, f64)>,
    pub view: Option<ViewData>,
}

#[derive(Serialize)]
struct MethodBar {
    name: String,
    soft_ratio: Option<f64>,
    energy: Option<f64>,
    soft_mm: Option<f64>,
    soft_std: Option<f64>,
}

#[derive(Serialize)]
struct OverTime {
    clip: String,
    fps: f32,
    curves: Vec<(String, Vec<f32>)>,
}

#[derive(Serialize)]
struct SubspaceRow {
    latent: u32,
    pca: Option<f64>,
    ae: Option<f64>,
    scan_pca: Option<f64>,
    scan_ae: Option<f64>,
}

/// One chart with a name to choose it by, e.g. a region.
#[derive(Serialize)]
struct RegionCurves {
    name: String,
    curves: Vec<(String, Vec<[f64; 2]>)>,
}

impl PageData {
    pub fn new(input: &ReportInput) -> Self {
        let mut methods: Vec<String> = input.metrics.methods.keys().filter(|n| !is_channel(n)).cloned().collect();
        methods.sort_by(|a, b| by_rank(a, b));
        let mut labels: BTreeMap<String, String> = methods.iter().map(|n| (n.clone(), method_label(n))).collect();
        labels.insert("truth".into(), if input.metrics.truth { "truth" } else { "scans" }.into());
        Self {
            bars: methods.iter().map(|n| bar(input, n)).collect(),
            over_time: over_time(input, &methods),
            subspace: subspace(input),
            spectra: spectra(input, &methods),
            decays: decays(input, &methods),
            training: training(input),
            shapes: input.metrics.shape_response.iter().map(|(n, c)| (n.clone(), c.clone())).collect(),
            bmi: body_mass(input),
            people: people(input, &methods),
            subspace_time: subspace_time(input),
            subspace_people: subspace_people(input),
            timing: timing(input),
            view: view(input),
            labels,
            methods,
        }
    }
}

fn bar(input: &ReportInput, name: &str) -> MethodBar {
    let m = &input.metrics.methods[name];
    let soft = m.regions.get("soft").copied().unwrap_or_default();
    MethodBar {
        name: name.to_owned(),
        soft_ratio: m.soft_ratio,
        energy: soft.energy_ratio,
        soft_mm: soft.mean_mm,
        soft_std: soft.std_mm,
    }
}

fn over_time(input: &ReportInput, methods: &[String]) -> Vec<OverTime> {
    let clips = input.tally.map_or(&[][..], |t| &t.clips);
    let other = |clip: &crate::ClipCurves, region: &str| {
        let curve = |n: &String| {
            let curve = clip.methods.get(n)?.get(region)?;
            Some((n.clone(), curve.iter().map(|x| *x as f32).collect()))
        };
        let name = format!("{} · {}", clip.id(), if region == "all" { "all vertices" } else { "belly and chest" });
        OverTime { clip: name, fps: clip.fps, curves: methods.iter().filter_map(curve).collect() }
    };
    let kept = &input.metrics.over_time;
    let others = ["belly-chest", "all"].iter().flat_map(|region| kept.iter().map(|clip| other(clip, region)));
    let rounded = |x: &f32| (x * 1000.0).round() / 1000.0;
    clips
        .iter()
        .map(|clip| {
            let curve = |n: &String| {
                let tally = clip.methods.get(n)?.as_ref()?;
                Some((n.clone(), tally.reference.over_time("soft").iter().map(rounded).collect()))
            };
            OverTime {
                clip: format!("{} · soft vertices", clip.id),
                fps: clip.fps,
                curves: methods.iter().filter_map(curve).collect(),
            }
        })
        .chain(others.filter(|o| !o.curves.is_empty()))
        .collect()
}

fn subspace(input: &ReportInput) -> Vec<SubspaceRow> {
    let row = |(latent, m): (&u32, &crate::SubspaceMetrics)| SubspaceRow {
        latent: *latent,
        pca: m.pca_mm,
        ae: m.ae_mm,
        scan_pca: m.scan_pca_mm,
        scan_ae: m.scan_ae_mm,
    };
    input.metrics.subspace.iter().map(row).collect()
}

/// Error over time of each size, PCA and autoencoder, a chart a clip.
fn subspace_time(input: &ReportInput) -> Vec<RegionCurves> {
    let points = |mm: &[f64], fps: f32| -> Vec<[f64; 2]> {
        mm.iter().enumerate().map(|(t, y)| [t as f64 / f64::from(fps), *y]).collect()
    };
    let chart = |clip: &crate::ClipCurves| {
        let pair = |(latent, c): (&u32, &crate::CodecCurves)| {
            let named = [(format!("PCA-{latent}"), &c.pca_mm), (format!("AE-{latent}"), &c.ae_mm)];
            named.map(|(name, mm)| (name, points(mm, clip.fps)))
        };
        let curves = clip.subspace.iter().flat_map(pair).filter(|(_, c)| !c.is_empty()).collect();
        RegionCurves { name: clip.id().to_string(), curves }
    };
    input.metrics.over_time.iter().map(chart).filter(|c| !c.curves.is_empty()).collect()
}

/// Points sorted along the axis, where everybody's shape is known.
fn along_shape(input: &ReportInput, of: impl Fn(&str) -> Option<f64>) -> Vec<[f64; 2]> {
    let people = input.metrics.people.iter();
    let mut points: Vec<[f64; 2]> = people.filter_map(|(name, p)| Some([p.beta_1?, of(name)?])).collect();
    points.sort_by(|a, b| a[0].total_cmp(&b[0]));
    points
}

/// Error by shape of each size, PCA and autoencoder.
fn subspace_people(input: &ReportInput) -> Vec<(String, Vec<[f64; 2]>)> {
    let tables = &input.metrics.subspace_by_subject;
    let pair = |latent: &u32| {
        let row = |name: &str| tables.get(name)?.get(latent);
        let pca = along_shape(input, |n| row(n).and_then(|m| m.pca_mm.or(m.scan_pca_mm)));
        let ae = along_shape(input, |n| row(n).and_then(|m| m.ae_mm.or(m.scan_ae_mm)));
        [(format!("PCA-{latent}"), pca), (format!("AE-{latent}"), ae)]
    };
    input.metrics.subspace.keys().flat_map(pair).filter(|(_, c)| !c.is_empty()).collect()
}

/// Each method by shape.
fn people(input: &ReportInput, methods: &[String]) -> Vec<RegionCurves> {
    type Figure = fn(&crate::PersonFigures) -> Option<f64>;
    let charts: [(&str, Figure); 4] = [
        ("Soft ratio", |f| f.soft_ratio),
        ("Error of soft vertices, mm", |f| f.soft_mm),
        ("Error of all vertices, mm", |f| Some(f.mean_mm)),
        ("Energy", |f| f.energy_ratio),
    ];
    let chart = |(name, figure): (&str, Figure)| {
        let of = |m: &String| {
            let person = |n: &str| input.metrics.people.get(n)?.methods.get(m).and_then(figure);
            (m.clone(), along_shape(input, person))
        };
        let curves = methods.iter().map(of).filter(|(_, c)| !c.is_empty()).collect();
        RegionCurves { name: name.to_owned(), curves }
    };
    charts.into_iter().map(chart).filter(|c| !c.curves.is_empty()).collect()
}

fn body_mass(input: &ReportInput) -> Vec<RegionCurves> {
    let chart = |name: &str, figure: fn(&crate::BmiMetrics) -> f64| {
        let curve =
            |(n, c): (&String, &Vec<crate::BmiMetrics>)| (n.clone(), c.iter().map(|p| [p.bmi, figure(p)]).collect());
        RegionCurves { name: name.to_owned(), curves: input.metrics.bmi_response.iter().map(curve).collect() }
    };
    let charts = [
        chart("Mean vertex speed of the deltas, mm/s", |p| p.speed_mm_s),
        chart("Amplitude of soft vertices, mm", |p| p.amplitude_mm),
    ];
    charts.into_iter().filter(|c| !c.curves.is_empty()).collect()
}

fn timing(input: &ReportInput) -> Vec<(String, f64)> {
    let mut times: Vec<_> = input.metrics.timing.iter().map(|(n, t)| (n.clone(), t.whole_ms)).collect();
    times.sort_by(|a, b| by_rank(&a.0, &b.0));
    times
}

fn spectra(input: &ReportInput, methods: &[String]) -> Vec<RegionCurves> {
    let Some(tally) = input.tally else { return Vec::new() };
    // decibels over 1 mm^2/Hz; silence has no curve
    let curve = |s: Spectrum| -> Vec<[f64; 2]> {
        s.hz.iter()
            .zip(&s.power)
            .filter(|(_, p)| **p > 1e-12)
            .map(|(f, p)| [*f, (100.0 * p.log10()).round() / 10.0])
            .collect()
    };
    let region = |r: &softtissue_body::Region| {
        let reference = tally.mean_spectrum(None, *r)?;
        let mut curves = vec![("truth".to_owned(), curve(reference))];
        curves.extend(methods.iter().filter_map(|m| Some((m.clone(), curve(tally.mean_spectrum(Some(m), *r)?)))));
        curves.retain(|(_, c)| !c.is_empty());
        Some(RegionCurves { name: r.name().to_owned(), curves })
    };
    MOVING.iter().filter_map(region).collect()
}

fn decays(input: &ReportInput, methods: &[String]) -> Vec<RegionCurves> {
    let chart = |d: &crate::DecayTrace| {
        let names = std::iter::once("truth").chain(methods.iter().map(String::as_str));
        let points = |c: &Vec<f32>| {
            let mean = c.iter().sum::<f32>() / c.len().max(1) as f32;
            let point = |(t, x): (usize, &f32)| [t as f64 / f64::from(d.fps), f64::from(x - mean)];
            c.iter().enumerate().map(point).collect()
        };
        let curves = names.filter_map(|n| Some((n.to_owned(), points(d.curves.get(n)?)))).collect();
        RegionCurves { name: format!("{} · {}", d.region.name(), d.subject), curves }
    };
    input.decays.iter().map(chart).collect()
}

fn training(input: &ReportInput) -> Vec<RegionCurves> {
    let mut charts: Vec<RegionCurves> = Vec::new();
    for curve in input.training {
        let line = (curve.name.clone(), curve.points.clone());
        match charts.iter_mut().find(|c| c.name == curve.stage) {
            Some(chart) => chart.curves.push(line),
            None => charts.push(RegionCurves { name: curve.stage.clone(), curves: vec![line] }),
        }
    }
    charts
}

fn view(input: &ReportInput) -> Option<ViewData> {
    let surface = Surface { faces: &input.body.topology.faces, regions: Some(&input.body.regions) };
    let data = || ViewData::new(&surface, input.playback, Some("reference"), PLAYBACK_BYTES);
    (!input.playback.is_empty()).then(data)
}
