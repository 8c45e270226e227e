//! The report as a file: whole, alone, and honest about what is not there.

mod figure;

use figure::{OnBody, Oscillator, World, body, motion, truth};
use softtissue_eval::report::{ReportInput, write};
use softtissue_eval::viewer::playback;
use softtissue_eval::{
    BmiMetrics, CodecCurves, FitMetrics, Gate, Metrics, PersonFigures, PersonMetrics, SubspaceMetrics, SubspaceTable,
    Tally, TimingMetrics, acceptance, curves, judge,
};
use softtissue_monitor::Silent;
use std::path::Path;

fn judged(root: &Path) -> (World, Tally, Metrics) {
    let w = World::make(root, body(12, 10), &[motion("s01", "hop", 1.6, 90, 90)]);
    let mut tally = Tally::default();
    let method = OnBody(&w.body, Oscillator { name: "softtissue", hz: 3.3, ..truth() });
    judge(&mut tally, &w.scene(), &[&method], &w.clips, None, &Silent).unwrap();
    let metrics = tally.metrics("held-out", 7);
    (w, tally, metrics)
}

fn plain<'a>(w: &'a World, metrics: &'a Metrics) -> ReportInput<'a> {
    ReportInput {
        title: "run",
        metrics,
        tally: None,
        decays: &[],
        facts: &[],
        stages: &[],
        training: &[],
        body: &w.body,
        playback: &[],
    }
}

fn text(input: &ReportInput, root: &Path) -> String {
    let path = root.join("report/index.html");
    write(input, &path).unwrap();
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn a_report_loads_nothing_and_holds_the_figures() {
    let folder = tempfile::tempdir().unwrap();
    let (w, tally, mut metrics) = judged(folder.path());
    metrics.gates = acceptance(&metrics);
    let ours = OnBody(&w.body, Oscillator { name: "softtissue", hz: 3.3, ..truth() });
    let clip = playback(&w.scene(), &ours, &w.clips[0]).unwrap();
    let html = text(&ReportInput { tally: Some(&tally), playback: &[clip], ..plain(&w, &metrics) }, folder.path());
    // the one address is the name of the SVG language
    let addresses: Vec<&str> = html.match_indices("http").map(|(i, _)| &html[i..(i + 26).min(html.len())]).collect();
    assert!(
        addresses.iter().all(|a| a.starts_with("http://www.w3.org/2000/svg") || a.starts_with("http-equiv")),
        "{addresses:?}"
    );
    assert!(!html.contains("<link rel=\"stylesheet\"") && !html.contains("src=\""));
    let soft = metrics.methods["softtissue"].regions["soft"];
    assert!(html.contains(&format!(
        "{:.2}<span class=\"pm\">±{:.2}</span>",
        soft.mean_mm.unwrap(),
        soft.std_mm.unwrap()
    )));
    assert!(
        html.contains("id=\"view-reference\"") && html.contains(r#"{"key":"alone","label":"Body alone","over":null}"#)
    );
    let clip = &metrics.clips[0].methods["body"].regions["soft"];
    assert!(html.contains(&format!(
        "{:.2}<span class=\"pm\">±{:.2}</span>",
        clip.mean_mm.unwrap(),
        clip.std_mm.unwrap()
    )));
    assert!(html.contains("<th scope=\"row\">s01/hop.0</th>"));
    assert!(html.contains("not measured"), "gates without a figure say so");
    assert!(html.ends_with("</html>"));
}

#[test]
fn what_is_empty_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let (w, _, _) = judged(folder.path());
    let nothing = Tally::default().metrics("held-out", 7);
    let html = text(&plain(&w, &nothing), folder.path());
    for id in ["view", "gates", "errors", "motion", "subspace", "timing", "fit", "run"] {
        assert!(!html.contains(&format!("<section id=\"{id}\"")) && !html.contains(&format!("href=\"#{id}\"")), "{id}");
    }
    assert!(html.contains("<section id=\"words\""));
}

#[test]
fn people_subspaces_body_mass_and_times_are_drawn_where_they_were_measured() {
    let folder = tempfile::tempdir().unwrap();
    let (w, tally, mut metrics) = judged(folder.path());
    let charts = ["people", "subspace-people", "subspace-time", "bmi", "timing"].map(|c| format!("id=\"chart-{c}\""));
    let html = text(&ReportInput { tally: Some(&tally), ..plain(&w, &metrics) }, folder.path());
    assert!(charts.iter().all(|c| !html.contains(c)));
    let row = SubspaceMetrics { pca_mm: Some(1.0), ae_mm: Some(0.9), ..Default::default() };
    metrics.subspace.insert(25, row);
    for (name, beta) in [("s01", 1.5), ("s02", -2.0)] {
        metrics.subspace_by_subject.insert(name.into(), [(25, row)].into());
        let figures = PersonFigures { mean_mm: 1.25, soft_ratio: Some(0.625), ..Default::default() };
        let methods = [("softtissue".to_owned(), figures)].into();
        metrics.people.insert(name.into(), PersonMetrics { beta_1: Some(beta), methods });
    }
    let codec = CodecCurves { pca_mm: vec![1.0, 1.5], ae_mm: vec![0.75, 1.25] };
    let table = SubspaceTable { over_time: [(w.clips[0].clone(), [(25, codec)].into())].into(), ..Default::default() };
    metrics.over_time = curves(&tally, &table, &["softtissue"], |_| true);
    metrics
        .bmi_response
        .insert("softtissue".into(), vec![BmiMetrics { bmi: 18.0, speed_mm_s: 7.5, amplitude_mm: 2.5 }]);
    let timing = TimingMetrics { frames: 300, whole_ms: 1.5, whole_p95_ms: 1.75, ..Default::default() };
    metrics.timing.insert("softtissue".into(), timing);
    let html = text(&ReportInput { tally: Some(&tally), ..plain(&w, &metrics) }, folder.path());
    assert!(charts.iter().all(|c| html.contains(c)));
    // the heaviest stands to the left
    assert!(html.contains(r#""subspace_people":[["PCA-25",[[-2.0,1.0],[1.5,1.0]]],["AE-25",[[-2.0,0.9],[1.5,0.9]]]]"#));
    assert!(html.contains(r#"["AE-25",[[0.0,0.75],[0.0166"#));
    assert!(html.contains(r#""timing":[["softtissue",1.5]]"#) && html.contains("<td>1.75</td>"));
    assert!(html.contains("· belly and chest") && html.contains("· all vertices"), "other regions over time");
}

#[test]
fn names_from_outside_stay_text() {
    let folder = tempfile::tempdir().unwrap();
    let (w, tally, mut metrics) = judged(folder.path());
    let evil = "</script><script>alert(1)</script>";
    metrics.gates.insert(evil.into(), Gate::new(evil, evil, Some(1.0), None, Some(2.0)));
    let ours = metrics.methods["softtissue"].clone();
    metrics.methods.insert(evil.into(), ours);
    let facts = [(evil.to_owned(), evil.to_owned())];
    let html =
        text(&ReportInput { title: evil, tally: Some(&tally), facts: &facts, ..plain(&w, &metrics) }, folder.path());
    assert!(!html.contains("alert(1)</script>"));
    assert_eq!(html.matches("<script").count(), 2, "the data and the page's own");
}

#[test]
fn the_fit_table_says_what_the_objectives_differ_by() {
    let folder = tempfile::tempdir().unwrap();
    let (w, _, mut metrics) = judged(folder.path());
    let mut sentence = |posed: f64, unposed: f64| {
        let of = |mm| FitMetrics { delta_mm_mean: Some(mm), ..Default::default() };
        metrics.fit_objectives = [("posed".to_owned(), of(posed)), ("unposed".to_owned(), of(unposed))].into();
        text(&plain(&w, &metrics), folder.path())
    };
    assert!(sentence(2.0, 1.0).contains("50 % closer to the truth"));
    assert!(sentence(1.0, 1.03).contains("less than 5 %"));
    assert!(sentence(1.0, 1.5).contains("the posed objective recovers the deltas 50 % better"));
}

#[test]
fn a_played_clip_is_the_posed_body() {
    let folder = tempfile::tempdir().unwrap();
    let (w, _, _) = judged(folder.path());
    let exact = OnBody(&w.body, truth());
    let clip = playback(&w.scene(), &exact, &w.clips[0]).unwrap();
    let frames = |key: &str| &clip.layer(key).unwrap().frames;
    assert_eq!(frames("reference"), frames("predicted"));
    let clean = w.truth.clean(&w.clips[0]).unwrap().vertices;
    for t in [0, 40, 89] {
        for (v, p) in clean.frame(t).iter().enumerate() {
            let played = frames("alone").frame(t)[v] + frames("reference").frame(t)[v];
            assert!((played - *p).length() < 1e-5, "frame {t}, vertex {v}: {played} {p}");
        }
    }
}
