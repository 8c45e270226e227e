//! Runs beside each other on one run's test clips.

use crate::support::{Said, bytes_below, copy_of_the_run, folder, measures, softtissue, tiny_run, tiny_train};
use softtissue_eval::Metrics;
use std::path::{Path, PathBuf};

/// Trains another run on the shared scans, without judging it.
fn trained(home: &Path, name: &str, settings: &[&str]) -> PathBuf {
    let out = home.join(name);
    let mut train = tiny_train(&tiny_run().config, &out);
    settings.iter().for_each(|s| {
        train.args(["--set", s]);
    });
    train.arg("--no-eval");
    Said::of(&train.output().expect("the command starts")).fine();
    out
}

#[test]
fn other_runs_are_judged_beside_a_run_but_not_on_what_they_have_seen() {
    let home = folder("comparison");
    let run = copy_of_the_run("compared");
    let text = |path: &Path| path.display().to_string();
    let before = std::fs::read(run.join("metrics.json")).expect("measures");
    let other = trained(&home, "linear", &["regressor.shortcut=linear", "seed=5", "synth.seed=1"]);
    let said = softtissue(&["eval", &text(&run), "--against", &text(&other), "--against", &text(&run.join("bundle"))]);
    said.fine();
    assert!(said.out.contains("softtissue/linear"), "{}", said.out);
    let compared = Metrics::read(&run.join("comparison/metrics.json")).expect("measures");
    assert!(run.join("comparison/report/index.html").exists());
    assert_eq!(std::fs::read(run.join("metrics.json")).expect("measures"), before, "the run's own stay");
    // the same bundle under another name is judged alike, another one is not
    let (own, there) = (measures(&run), |name: &str| compared.methods[name].clone().regions);
    assert_eq!(there("softtissue"), own.methods["softtissue"].regions);
    assert_eq!(there("softtissue/bundle"), own.methods["softtissue"].regions);
    assert_ne!(there("softtissue/linear"), own.methods["softtissue"].regions);
    assert_eq!(compared.shape_response.len(), 3);
    assert!(compared.methods["softtissue/linear"].bounded_ratio.is_some());

    let leak = trained(&home, "leak", &["split.test_motions=[\"punching\"]"]);
    let said = softtissue(&["eval", &text(&run), "--against", &text(&leak)]);
    said.refused(3, &["was trained on", "one_leg_jump", "leak"]);
    let leak = trained(&home, "selected", &["split.test_motions=[]", "split.validation_motions=[\"one_leg_jump\"]"]);
    softtissue(&["eval", &text(&run), "--against", &text(&leak)]).refused(3, &["was selected on", "one_leg_jump"]);
    let protocol = ["eval", &text(&run), "--against", &text(&other), "--protocol", "leave-one-subject-out"];
    softtissue(&protocol).refused(2, &["--against", "--protocol"]);
}

#[test]
fn a_run_is_judged_on_scans_of_other_flesh_without_learning_from_them() {
    let home = folder("other-flesh");
    let run = copy_of_the_run("judged-on-others");
    let scans = home.join("second-law");
    let text = |path: &Path| path.display().to_string();
    let config = text(&tiny_run().config);
    let other = ["--set", "synth.flesh.law=second", "--set", "synth.subjects.other_flesh=1"];
    softtissue(&[&["synth", "--config", &config, "--out", &text(&scans)], &other[..]].concat()).fine();
    let own = measures(&run);
    let stages = bytes_below(&run.join("stages"));
    softtissue(&["eval", &text(&run), "--on", &text(&scans)]).fine();
    let found = Metrics::read(&run.join("on-second-law/metrics.json")).expect("measures");
    assert!(run.join("on-second-law/report/index.html").exists());
    assert!(found.truth && found.clips.len() == own.clips.len());
    assert_ne!(found.methods["softtissue"].soft_ratio, own.methods["softtissue"].soft_ratio);
    assert_eq!(found.methods["body"].soft_ratio, Some(1.0));
    assert_eq!(bytes_below(&run.join("stages")), stages, "nothing is learned");
    assert_eq!(measures(&run), own, "the run's own stay");
    softtissue(&["eval", &text(&run), "--on", &text(&home.join("nowhere"))]).refused(3, &["nowhere"]);
}

#[test]
fn the_simulator_answers_for_a_person_of_mean_flesh() {
    let run = copy_of_the_run("with-oracle");
    let config = run.join("config.toml");
    let text = std::fs::read_to_string(&config).expect("settings");
    std::fs::write(&config, text.replace("oracle = false", "oracle = true")).expect("settings");
    softtissue(&["eval", &run.display().to_string()]).fine();
    let found = measures(&run);
    let ratio = |name: &str| found.methods[name].soft_ratio.expect("a soft ratio");
    assert!(ratio("oracle") < 0.5 * ratio("resonators"), "{} {}", ratio("oracle"), ratio("resonators"));
    assert!(!found.methods.contains_key("oracle/fitted"), "only true motion is asked");
    // heavier people move more (SoftSMPL fig. 8)
    let curve = &found.shape_response["oracle"];
    assert!(curve.first().expect("heavy")[1] > 1.5 * curve.last().expect("light")[1], "{curve:?}");
}
