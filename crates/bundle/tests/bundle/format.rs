use crate::tiny::{Parts, autoregressive, autoregressive_of, bundle, motion, recurrent_of};
use glam::Vec3;
use softtissue_bundle::descriptor::{FeatureKind, FeatureScaling};
use softtissue_bundle::*;
use softtissue_geometry::Frames;
use softtissue_random::Draws;
use softtissue_store::sha256_bytes;
use std::path::Path;

#[test]
fn a_bundle_reads_back_and_plays_the_same_to_the_bit() {
    let (rotations, translations) = motion(50);
    for parts in [
        Parts::default(),
        Parts { bank: false, recurrent: false, units: 0, look_ahead: 2, ..Default::default() },
        Parts { features: FeatureKind::Pose, direct: false, ..Default::default() },
        Parts { features: FeatureKind::DisentangledPose, bank: false, ..Default::default() },
        Parts { acquainted: true, ..Default::default() },
    ] {
        let dir = tempfile::tempdir().unwrap();
        let written = bundle(parts);
        written.write(dir.path()).unwrap();
        let read = Bundle::read(dir.path()).unwrap();
        assert_eq!(read.info, written.info);
        assert_eq!(read.manifest().unwrap(), written.manifest().unwrap());
        assert_eq!((&read.model, &read.trust), (&written.model, &written.trust));
        assert_eq!((&read.descriptor, &read.self_check), (&written.descriptor, &written.self_check));
        let play = |bundle: &Bundle| {
            Player::new(bundle, &[0.2, 0.9]).unwrap().rollout_vertices(&rotations, &translations).unwrap()
        };
        assert_eq!(play(&read), play(&written), "{parts:?}");
        read.require_topology(dir.path(), &written.body.topology.hash()).unwrap();
        let other = read.require_topology(dir.path(), "0123456789abcdef").unwrap_err();
        assert!(matches!(other, BundleError::Topology { .. }));
    }
}

#[test]
fn a_new_bundle_replaces_an_older_one() {
    let dir = tempfile::tempdir().unwrap();
    bundle(Parts::default()).write(dir.path()).unwrap();
    let second = bundle(Parts { recurrent: false, ..Default::default() });
    second.write(dir.path()).unwrap();
    assert!(Bundle::read(dir.path()).unwrap().model.recurrent().unwrap().regressor.recurrent.is_none());
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 3);
}

#[test]
fn what_would_be_refused_is_not_written() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("out");
    let mut short = bundle(Parts::default());
    recurrent_of(&mut short).regressor.shortcut.bias.pop();
    let mut nan = bundle(Parts::default());
    recurrent_of(&mut nan).subspace.basis.mean[3] = f32::NAN;
    let mut check = bundle(Parts::default());
    check.self_check = SelfCheck::default();
    let disentangled = || bundle(Parts { features: FeatureKind::DisentangledPose, bank: false, ..Default::default() });
    let acquainted = || bundle(Parts { acquainted: true, ..Default::default() });
    let (mut nobody, mut greedy, mut alone) = (acquainted(), acquainted(), acquainted());
    recurrent_of(&mut nobody).regressor.acquaintance.as_mut().unwrap().people = Matrix::zeros(2, 3);
    recurrent_of(&mut greedy).regressor.acquaintance.as_mut().unwrap().stranger = 1.5;
    recurrent_of(&mut alone).regressor.recurrent = None;
    let (mut without, mut other, mut idle) = (disentangled(), disentangled(), bundle(Parts::default()));
    let encoder = recurrent_of(&mut without).pose_encoder.take();
    recurrent_of(&mut idle).pose_encoder = encoder.clone();
    let mut wide = encoder.unwrap();
    std::sync::Arc::make_mut(&mut wide).layers.remove(0);
    recurrent_of(&mut other).pose_encoder = Some(wide);
    for (bundle, says) in [
        (short, "shortcut"),
        (nan, "basis.mean"),
        (check, "self-check"),
        (without, "encoder is missing"),
        (other, "6 numbers come in"),
        (idle, "do not use"),
        (nobody, "people has size [3], expected [2]"),
        (greedy, "shares are 0.7 and 1.5"),
        (alone, "does not have"),
    ] {
        let message = bundle.write(&path).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
        assert!(!path.exists(), "{message}");
    }
}

/// The format is pinned: a change of these bytes is a change of format and needs a new version.
#[test]
fn the_format_does_not_drift() {
    let dir = tempfile::tempdir().unwrap();
    let mut bundle = bundle(Parts::default());
    // Every number from draws: nothing here depends on a machine's mathematics library.
    let mut draws = Draws::new(1, "pinned", 0, 0);
    let mut number = || (draws.below(1000) as f32 - 500.0) / 1024.0;
    let scaling = |size: usize| FeatureScaling {
        input_size: size,
        kept: (0..size as u32).collect(),
        lower: vec![-1.5; size],
        upper: vec![2.0; size],
        scale: vec![0.75; size],
    };
    let regressor = &mut recurrent_of(&mut bundle).regressor;
    let d = regressor.input.input_size;
    regressor.input = scaling(d);
    let a = regressor.memory_count();
    regressor.shortcut = Linear {
        weight: Matrix::new(5, 3 * a + 2, (0..5 * (3 * a + 2)).map(|_| number()).collect()),
        bias: (0..5).map(|_| number()).collect(),
    };
    let recurrent = regressor.recurrent.as_mut().unwrap();
    recurrent.gru.w_ih = Matrix::new(18, d + 2, (0..18 * (d + 2)).map(|_| number()).collect());
    regressor.acquaintance = Some(Acquaintance {
        around: Linear {
            weight: Matrix::new(5, d + 2, (0..5 * (d + 2)).map(|_| number()).collect()),
            bias: (0..5).map(|_| number()).collect(),
        },
        share: 0.5,
        stranger: 0.25,
        people: Matrix::new(2, 2, (0..4).map(|_| number()).collect()),
    });
    let mut points =
        |count: usize| -> Vec<Vec3> { (0..count).map(|_| Vec3::new(number(), number(), number())).collect() };
    bundle.self_check = SelfCheck {
        beta: vec![0.5, -0.25],
        rotations: Frames::from_points(3, points(6)),
        translations: points(2),
        vertices: vec![4, 9],
        deltas: Frames::from_points(2, points(4)),
    };
    let check = bundle.self_check.clone();
    let features = bundle.trust.mean.len();
    bundle.trust.mean = vec![0.25; features];
    bundle.trust.scale = vec![0.5; features];
    hashes_to(&bundle, dir.path(), PINNED);

    let mut mixture = autoregressive();
    let model = autoregressive_of(&mut mixture);
    model.input = scaling(model.input.input_size);
    let d = model.input.len();
    for PersonDynamics { dynamics, .. } in &mut model.people {
        dynamics.weight = Matrix::new(7, d, (0..7 * d).map(|_| number()).collect());
    }
    mixture.self_check = check;
    let features = mixture.trust.mean.len();
    mixture.trust.mean = vec![0.25; features];
    mixture.trust.scale = vec![0.5; features];
    hashes_to(&mixture, dir.path(), PINNED_AUTOREGRESSIVE);

    for (precision, pinned) in [(Precision::F16, PINNED_F16), (Precision::I8, PINNED_I8)] {
        // With the drawn self-check: what a machine plays is not pinned.
        let Bundle { model, .. } = bundle.reduced(precision).unwrap();
        hashes_to(&Bundle { model, ..bundle.clone() }, dir.path(), pinned);
    }
}

#[track_caller]
fn hashes_to(bundle: &Bundle, dir: &Path, pinned: [&str; 3]) {
    bundle.write(dir).unwrap();
    let hash = |name: &str| sha256_bytes(&std::fs::read(dir.join(name)).unwrap());
    let found = [hash("model.safetensors"), hash("body.safetensors"), hash(MANIFEST_FILE)];
    assert_eq!(found.each_ref().map(|h| &h[..16]), pinned, "the bundle format has changed: {}", size_of(dir));
}

/// First halves of SHA-256 of model, body and manifest, format version 7.
const PINNED: [&str; 3] = ["2a394812327e4d21", "af6ad361708e92ad", "1c86c6a5761027c4"];
/// The same of a bundle of autoregressions.
const PINNED_AUTOREGRESSIVE: [&str; 3] = ["4286d1064010ba8a", "af6ad361708e92ad", "114b284c8a2286e1"];
/// The same of the first bundle in fewer bits.
const PINNED_F16: [&str; 3] = ["2d2cf165040a6e74", "af6ad361708e92ad", "c035b08bce86f613"];
const PINNED_I8: [&str; 3] = ["9d5ab1e61de732b4", "af6ad361708e92ad", "dd1c0f01bbfebc65"];

fn size_of(dir: &Path) -> String {
    let sizes =
        ["model.safetensors", "body.safetensors", MANIFEST_FILE].map(|f| std::fs::metadata(dir.join(f)).unwrap().len());
    format!("now {sizes:?} bytes, format version {FORMAT_VERSION}")
}
