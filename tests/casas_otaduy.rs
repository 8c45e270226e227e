//! The method of Casas and Otaduy through the real command: learned, judged, animated.

use crate::support::{Said, folder, measures, softtissue, tiny_run, tiny_train};
use softtissue_bundle::{Bundle, Model};
use softtissue_eval::Metrics;

const SETTINGS: [&str; 9] = [
    "method=casas-otaduy",
    "casas_otaduy.sizes=[8, 16]",
    "casas_otaduy.latents=16",
    "casas_otaduy.autoencoder.widths=[40, 36]",
    "casas_otaduy.autoencoder.steps=6",
    "casas_otaduy.regressor.width=48",
    "casas_otaduy.regressor.steps=12",
    "casas_otaduy.regressor.rollout_every=5",
    "eval.decay_subjects=0",
];

#[test]
fn each_person_gets_networks_that_are_judged_and_move_a_body() {
    let home = folder("casas-otaduy");
    let out = home.join("run");
    let mut train = tiny_train(&tiny_run().config, &out);
    SETTINGS.iter().for_each(|s| {
        train.args(["--set", s]);
    });
    let said = Said::of(&train.output().expect("the command starts"));
    said.fine();
    assert!(said.out.contains("casas-otaduy"), "{}", said.out);
    let metrics = measures(&out);
    assert_eq!(metrics.method.as_deref(), Some("casas-otaduy"));
    let own = &metrics.methods["casas-otaduy"];
    assert!(own.soft_ratio.is_some_and(|r| r > 0.0 && r < 10.0), "{:?}", own.soft_ratio);
    assert!(own.bounded_ratio.is_some_and(f64::is_finite) && own.diverged_clips.is_none());
    for region in ["all", "belly", "chest"] {
        let figures = own.regions[region];
        assert!(figures.mean_mm.is_some() && figures.std_mm.is_some(), "{region}: {figures:?}");
    }
    // Everyone's autoencoder beside their own principal components, and all of them together.
    assert_eq!(metrics.subspace_by_subject.keys().collect::<Vec<_>>(), ["s00", "s01"]);
    for table in metrics.subspace_by_subject.values().chain([&metrics.subspace]) {
        for size in [8, 16] {
            let (pca, own) = (table[&size].pca_mm.expect("PCA"), table[&size].ae_mm.expect("an autoencoder"));
            assert!((0.8..1.2).contains(&(own / pca)), "after a few steps it is still close to where it started");
        }
        assert!(table[&16].scan_pca_mm < table[&8].scan_pca_mm);
    }

    // Error over time of the heaviest person, and what a frame is made of.
    let curves = &metrics.over_time[0];
    assert_eq!((curves.subject.as_str(), curves.motion.as_str()), ("s01", "one_leg_jump"));
    assert!(["body", "casas-otaduy"].iter().all(|m| curves.methods[*m]["all"].len() == 48));
    assert!([8, 16].iter().all(|s| curves.subspace[s].pca_mm.len() == 48 && curves.subspace[s].ae_mm.len() == 48));
    let timed = Metrics::read(&out.join("metrics.json")).expect("measures").timing;
    let parts: Vec<&str> = timed["casas-otaduy"].parts.iter().map(|p| p.part.as_str()).collect();
    assert_eq!(parts, ["skinning", "descriptor", "regressor", "feedback"], "no decoder, no learned pose");

    let bundle = Bundle::read(&out.join("bundle")).expect("a bundle");
    let Model::Feedback(model) = &bundle.model else { panic!("another model: {:?}", bundle.info.method) };
    assert_eq!(model.people.iter().map(|p| p.name.as_str()).collect::<Vec<_>>(), ["s00", "s01"]);
    assert_eq!((model.feature_count(), model.people[0].latent_count(), model.people[0].pose_history()), (75, 16, 3));

    let text = |path: &std::path::Path| path.display().to_string();
    let glb = home.join("heavy.glb");
    let args =
        ["animate", "--bundle", &text(&out.join("bundle")), "--motion", "synth:jumping_jacks", "--shape", "0,-2"];
    softtissue(&[&args[..], &["--out", &text(&glb)]].concat()).fine();
    assert!(glb.metadata().expect("an animation").len() > 1000);
    softtissue(&["inspect", &text(&out.join("bundle"))]).fine();
    let network = text(&home.join("network.onnx"));
    softtissue(&["export", &text(&out.join("bundle")), "--onnx", &network]).refused(3, &["casas-otaduy", "ONNX"]);
}

#[test]
fn settings_that_cannot_work_are_refused() {
    let refused = |settings: &[&str], words: &[&str]| {
        let sets: Vec<&str> = settings.iter().flat_map(|s| ["--set", s]).collect();
        softtissue(&[&["train", "--dry-run"], &sets[..]].concat()).refused(2, words);
    };
    refused(&["casas_otaduy.latents=30"], &["casas_otaduy.latents is 30", "[50, 100]"]);
    refused(&["casas_otaduy.autoencoder.widths=[512, 199]"], &["widths", "principal"]);
    refused(&["casas_otaduy.regressor.own_latents=1.5"], &["own_latents is 1.5"]);
    refused(&["casas_otaduy.autoencoder.start=pca"], &["principal", "random"]);
    refused(&["method=casas"], &["casas-otaduy"]);
}
