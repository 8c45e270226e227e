use crate::scans::{CLEAN, Recipe, Truth, joint_errors, median};
use glam::Vec3;
use softtissue_clips::{ClipId, FitSet, ScanSet, Split};
use softtissue_fit::{FitConfig, FittedPeople, LevenbergMarquardt, fit_set, fit_set_with};
use softtissue_geometry::Frames;
use softtissue_monitor::Silent;
use std::path::{Path, PathBuf};

/// Files of a folder and their bytes, sorted.
fn files(root: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = vec![];
    for entry in std::fs::read_dir(root).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(&path));
        } else {
            found.push((path.clone(), std::fs::read(&path).unwrap()));
        }
    }
    found.sort();
    found
}

#[test]
fn a_poisoned_left_out_clip_changes_no_other_bytes() {
    let recipe = Recipe { frames: 16, flesh: 0.01, detail: 0.004, ..CLEAN };
    let truth = Truth::new(&recipe);
    let [walk, run, hop, new] =
        [("a", "walk"), ("a", "run"), ("a", "hop"), ("b", "walk")].map(|(s, m)| ClipId::new(s, m, 0));
    let ids = [walk.clone(), run.clone(), hop.clone(), new.clone()];
    let split = Split { train: vec![walk, run], validation: vec![], test: vec![hop.clone(), new] };
    let dir = tempfile::tempdir().unwrap();
    let scan_root = dir.path().join("scans");
    let scans = truth.write(&scan_root, &ids, &recipe);
    let fit = |name: &str| {
        let out = dir.path().join(name);
        fit_set(&scans, &split, &truth.body, &FitConfig::default(), &out, &Silent).unwrap();
        files(&out)
            .into_iter()
            .map(|(path, bytes)| (path.strip_prefix(&out).unwrap().to_owned(), bytes))
            .collect::<Vec<_>>()
    };
    let (before, again) = (fit("before"), fit("again"));
    assert_eq!(before, again, "the same scans must give the same bytes");
    let mut poisoned = truth.scan(&hop, &recipe);
    poisoned.vertices.points_mut().fill(Vec3::splat(1e6));
    poisoned.write(&ScanSet::scan_path(&scan_root, &hop)).unwrap();
    let after = fit("after");
    assert_eq!(before.len(), after.len());
    let mut changed = vec![];
    for ((path, a), (other, b)) in before.iter().zip(&after) {
        assert_eq!(path, other);
        if a != b {
            changed.push(path.display().to_string());
        }
    }
    let hop = hop.stem();
    let expected =
        [format!("deltas/{hop}.safetensors"), format!("motions/{hop}.safetensors"), "quality.json".to_owned()];
    assert_eq!(changed, expected, "only the poisoned clip's own files may change");
    let set = FitSet::open(&dir.path().join("after")).unwrap();
    assert!(set.clips().iter().all(|c| set.deltas(&c.id).is_ok()), "every file stays readable");
}

#[test]
fn people_taken_from_another_splits_fit_are_the_same_bytes_and_not_fitted_again() {
    let recipe = Recipe { frames: 12, flesh: 0.01, ..CLEAN };
    let truth = Truth::new(&recipe);
    let ids = [("a", "walk"), ("a", "run"), ("b", "walk"), ("b", "run"), ("c", "walk"), ("c", "run")]
        .map(|(s, m)| ClipId::new(s, m, 0));
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &ids, &recipe);
    let fit = |split: &Split, people: &FittedPeople, name: &str| {
        let (config, out) = (FitConfig::default(), dir.path().join(name));
        fit_set_with(&LevenbergMarquardt(&config), &scans, split, &truth.body, &config, people, &out, &Silent).unwrap();
        files(&out).into_iter().map(|(path, bytes)| (path.strip_prefix(&out).unwrap().to_owned(), bytes)).collect()
    };
    // c trains in the first split; in the second it is new, and borrows weights from people who are not fitted again.
    let [a_walk, a_run, b_walk, b_run, c_walk, c_run] = ids.clone();
    let train = vec![a_walk.clone(), b_walk.clone(), b_run.clone(), c_walk.clone()];
    let first = Split { train, validation: vec![a_run.clone()], test: vec![c_run.clone()] };
    let second = Split { train: vec![a_walk, b_walk, b_run], validation: vec![a_run], test: vec![c_walk, c_run] };
    let nobody = FittedPeople::new();
    let _: Vec<(PathBuf, Vec<u8>)> = fit(&first, &nobody, "first");
    let whole: Vec<_> = fit(&second, &nobody, "whole");
    // c does not train in the second split, and is not taken.
    let people = ["a", "b", "c"].map(|name| (name.to_owned(), dir.path().join("first"))).into();
    for id in &ids[..4] {
        let mut spoilt = truth.scan(id, &recipe);
        spoilt.vertices.points_mut().fill(Vec3::splat(1e6));
        spoilt.write(&ScanSet::scan_path(&dir.path().join("scans"), id)).unwrap();
    }
    let taken: Vec<_> = fit(&second, &people, "taken");
    assert_eq!(taken.len(), whole.len());
    for ((path, a), (other, b)) in whole.iter().zip(&taken) {
        assert!(path == other && a == b, "{} is another", path.display());
    }
}

#[test]
fn a_new_subject_is_fitted_from_the_starts_of_its_own_clips() {
    let recipe = Recipe { frames: 30, flesh: 0.005, detail: 0.001, ..CLEAN };
    let truth = Truth::new(&recipe);
    let ids = [("a", "walk"), ("a", "run"), ("b", "walk"), ("b", "run")].map(|(s, m)| ClipId::new(s, m, 0));
    let split = Split { train: ids[..2].to_vec(), validation: vec![], test: ids[2..].to_vec() };
    let dir = tempfile::tempdir().unwrap();
    let scans = truth.write(&dir.path().join("scans"), &ids, &recipe);
    let config = FitConfig { new_subject_frames: 8, smoothness: 0.0, ..Default::default() };
    let fit = fit_set(&scans, &split, &truth.body, &config, &dir.path().join("fit"), &Silent).unwrap();
    let (old, new) = (fit.subject("a").unwrap(), fit.subject("b").unwrap());
    let near = old.fit_weight.iter().zip(&new.fit_weight).all(|(a, b)| (a - b).abs() < 1e-5 * a);
    assert!(near && old.rigidity_weight.len() == new.rigidity_weight.len(), "weights of a new subject are borrowed");
    let (angles, _) = joint_errors(
        &truth.body,
        &new.beta,
        &fit.motion(&ids[3]).unwrap(),
        &truth.motion(&ids[3], &recipe),
        &truth.beta,
    );
    let degrees = median(angles).to_degrees();
    assert!(degrees < 1.0, "{degrees}");
    // what lies behind the first eight frames of its clips shapes nothing of it
    let mut changed = truth.scan(&ids[3], &recipe);
    let mut vertices = changed.vertices.slice(0..8);
    (8..30).for_each(|t| vertices.push(&changed.vertices.frame(t).iter().map(|p| *p + 0.1).collect::<Vec<_>>()));
    changed.vertices = vertices;
    changed.write(&ScanSet::scan_path(&dir.path().join("scans"), &ids[3])).unwrap();
    let again = fit_set(&scans, &split, &truth.body, &config, &dir.path().join("again"), &Silent).unwrap();
    assert_eq!(again.subject("b").unwrap(), new);
    assert_eq!(again.deltas(&ids[2]).unwrap(), fit.deltas(&ids[2]).unwrap());
    assert_ne!(again.motion(&ids[3]).unwrap(), fit.motion(&ids[3]).unwrap());
    let _: Frames = again.deltas(&ids[3]).unwrap().deltas;
}
