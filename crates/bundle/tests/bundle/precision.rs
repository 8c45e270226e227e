use crate::reference;
use crate::tiny::{Parts, autoregressive, bundle, feedback_bundle, motion, recurrent_of};
use serde_json::{Value, json};
use softtissue_bundle::descriptor::FeatureKind;
use softtissue_bundle::*;
use softtissue_store::sha256_bytes;
use std::path::Path;

const REDUCED: [Precision; 2] = [Precision::F16, Precision::I8];

#[test]
fn a_bundle_of_fewer_bits_reads_back_and_plays_the_same_to_the_bit() {
    let (rotations, translations) = motion(50);
    let mut cases = vec![(feedback_bundle(true), Precision::F16)];
    for precision in REDUCED {
        cases.push((bundle(Parts::default()), precision));
        cases.push((bundle(Parts { look_ahead: 2, bank: false, ..Default::default() }), precision));
        let disentangled = Parts { features: FeatureKind::DisentangledPose, bank: false, ..Default::default() };
        cases.push((bundle(disentangled), precision));
        cases.push((autoregressive(), precision));
    }
    for (whole, precision) in cases {
        let dir = tempfile::tempdir().unwrap();
        let reduced = whole.reduced(precision).unwrap();
        assert_eq!((whole.model.precision(), reduced.model.precision()), (Precision::F32, precision));
        reduced.write(dir.path()).unwrap();
        let read = Bundle::read(dir.path()).unwrap();
        assert_eq!((&read.model, &read.self_check), (&reduced.model, &reduced.self_check));
        assert_eq!(read.manifest().unwrap()["precision"], precision.name());
        let play = |bundle: &Bundle| {
            Player::new(bundle, &[0.2, 0.9]).unwrap().rollout_vertices(&rotations, &translations).unwrap()
        };
        assert_eq!(play(&read), play(&reduced));
        assert_ne!(play(&read), play(&whole));
        // What was written is what the f32 bundle would have to hold to be the same.
        let again = BundleFiles::read(dir.path()).unwrap();
        assert_eq!(Bundle::from_memory(again).unwrap().model, reduced.model);
    }
}

#[test]
fn a_rollout_in_fewer_bits_is_the_documented_sum_of_its_numbers_in_f64() {
    let (rotations, translations) = motion(120);
    let beta = [0.7, -1.3];
    let pose = Parts { features: FeatureKind::Pose, bank: false, ..Default::default() };
    let parts = [Parts::default(), pose, Parts { acquainted: true, ..Default::default() }];
    for (parts, precision) in parts.into_iter().flat_map(|p| REDUCED.map(|r| (p, r))) {
        let bundle = bundle(parts).reduced(precision).unwrap();
        let model = bundle.model.recurrent().unwrap();
        let (mut features, mut deltas) = (vec![], vec![]);
        let mut player = Player::new(&bundle, &beta).unwrap();
        player
            .play(&rotations, &translations, |_, player| {
                features.extend_from_slice(player.features());
                deltas.push(player.deltas().to_vec());
                Ok(())
            })
            .unwrap();
        let latents = reference::regress(&model.regressor, &features, &beta);
        let largest = deltas.iter().flatten().fold(0.0, |m: f32, d| m.max(d.length()));
        for (latent, deltas) in latents.iter().zip(&deltas) {
            let expected = reference::decode(&model.subspace, latent);
            for (d, e) in deltas.iter().flat_map(|d| d.to_array()).zip(expected) {
                // The shortcut of a body has eleven bits of its own.
                assert!((f64::from(d) - e).abs() < 1e-3 * f64::from(largest), "{parts:?} {precision:?}: {d} {e}");
            }
        }
    }
}

#[test]
fn the_loss_is_the_distance_of_the_two_players() {
    let whole = bundle(Parts::default());
    let reduced = whole.reduced(Precision::I8).unwrap();
    let beta = [0.4, -0.2];
    let (mut sum, mut count, mut worst) = (0.0, 0.0, 0.0f64);
    let mut loss = PrecisionLoss::default();
    for frames in [20, 45] {
        let (rotations, translations) = motion(frames);
        loss.add(&whole, &reduced, &beta, &rotations, &translations).unwrap();
        let play = |bundle: &Bundle| {
            let deltas = Player::new(bundle, &beta).unwrap().rollout(&rotations, &translations).unwrap();
            let shaped = bundle.body.shaped(&beta);
            bundle.body.posed_frames(&shaped, &rotations, &translations, Some(&deltas))
        };
        let (a, b) = (play(&whole), play(&reduced));
        for (a, b) in a.iter().zip(b.iter()) {
            for v in 4..26 {
                let distance = 1e3 * (a[v].as_dvec3() - b[v].as_dvec3()).length();
                (sum, count, worst) = (sum + distance, count + 1.0, worst.max(distance));
            }
        }
    }
    assert_eq!(loss.frames(), 65);
    // The body's own posing has correctives in f32; those of 3 mm lose at most a micrometre in sixteen bits.
    assert!((loss.mean_mm() - sum / count).abs() < 2e-3, "{} {}", loss.mean_mm(), sum / count);
    assert!((loss.max_mm() - worst).abs() < 5e-3 && worst > 0.0, "{} {worst}", loss.max_mm());
    let mut none = PrecisionLoss::default();
    let (rotations, translations) = motion(10);
    none.add(&whole, &whole, &beta, &rotations, &translations).unwrap();
    assert_eq!((none.mean_mm(), none.max_mm()), (0.0, 0.0));
    // Sixteen bits lose less than eight, if those are not refined: here all seven modes are, so both lose little.
    let mut sixteen = PrecisionLoss::default();
    let half = whole.reduced(Precision::F16).unwrap();
    sixteen.add(&whole, &half, &beta, &rotations, &translations).unwrap();
    assert!(sixteen.mean_mm() > 0.0 && sixteen.max_mm() < 0.5, "{sixteen:?}");
}

#[test]
fn what_cannot_be_reduced_is_refused() {
    let says = |bundle: &Bundle, precision, says: &str| {
        let message = bundle.reduced(precision).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
    };
    let half = bundle(Parts::default()).reduced(Precision::F16).unwrap();
    says(&half, Precision::I8, "a bundle in f16 to keep in i8");
    says(&feedback_bundle(true), Precision::I8, "choose f16");
    let mut large = bundle(Parts::default());
    recurrent_of(&mut large).subspace.decoder.lift.weight.data_mut()[3] = 7e4;
    says(&large, Precision::F16, "70000");
    assert_eq!(bundle(Parts::default()).reduced(Precision::F32).unwrap().model, bundle(Parts::default()).model);
    assert_eq!("i8".parse(), Ok(Precision::I8));
    assert!("i4".parse::<Precision>().unwrap_err().contains("expected f32, f16 or i8"));
}

/// Edits the arrays of a bundle as a forger would: header, data, then size and hash in the manifest.
fn forge(dir: &Path, edit: impl FnOnce(&mut Value, &mut Vec<u8>)) {
    let path = dir.join("model.safetensors");
    let bytes = std::fs::read(&path).unwrap();
    let n = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let mut header: Value = serde_json::from_slice(&bytes[8..8 + n]).unwrap();
    let mut data = bytes[8 + n..].to_vec();
    edit(&mut header, &mut data);
    let header = header.to_string();
    let bytes = [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), &data].concat();
    std::fs::write(path, &bytes).unwrap();
    let path = dir.join(MANIFEST_FILE);
    let mut manifest: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    manifest["files"][1]["bytes"] = json!(bytes.len());
    manifest["files"][1]["sha256"] = json!(sha256_bytes(&bytes));
    std::fs::write(path, manifest.to_string()).unwrap();
}

#[track_caller]
fn refused(precision: Precision, says: &str, edit: impl FnOnce(&mut Value, &mut Vec<u8>)) {
    let dir = tempfile::tempdir().unwrap();
    bundle(Parts::default()).reduced(precision).unwrap().write(dir.path()).unwrap();
    forge(dir.path(), edit);
    let message = Bundle::read(dir.path()).expect_err(says).to_string();
    assert!(message.contains(says) && !message.contains('\n'), "expected {says:?} in: {message}");
    assert!(message.contains(dir.path().to_str().unwrap()), "names no file: {message}");
}

fn start(header: &Value, name: &str) -> usize {
    header[name]["data_offsets"][0].as_u64().unwrap() as usize
}

#[test]
fn bad_input_65_factors_types_and_shapes_that_do_not_fit_are_refused() {
    const MODES: &str = "basis.directions";
    const SCALE: &str = "basis.directions.scale";
    for bad in [0.0, -0.5, f32::NAN, f32::INFINITY, 1e-40] {
        refused(Precision::I8, "basis.directions.scale holds", |header, data| {
            data[start(header, SCALE)..][..4].copy_from_slice(&bad.to_le_bytes());
        });
    }
    refused(Precision::I8, "expected I8", |header, _| header[MODES]["dtype"] = json!("U8"));
    refused(Precision::I8, "expected F32", |header, _| header[SCALE]["dtype"] = json!("U32"));
    refused(Precision::I8, "expected F16", |header, data| {
        // As many bytes of another type.
        let name = "decoder.lift.weight";
        let shape = header[name]["shape"].clone();
        header[name] = json!({"dtype": "I8", "shape": [shape[0], 2 * shape[1].as_u64().unwrap()],
            "data_offsets": header[name]["data_offsets"]});
        assert!(!data.is_empty());
    });
    refused(Precision::I8, "basis.directions.scale has shape", |header, _| header[SCALE]["shape"] = json!([7, 2]));
    // 14 rows of bytes are seven modes in two each; of three modes there is nothing to do with so many.
    refused(Precision::I8, "14 rows of bytes for 3 modes", |header, data| {
        let name = "basis.coefficient_mean";
        let (at, spare) = (start(header, name), 4 * 4);
        header[name] = json!({"dtype": "F32", "shape": [3], "data_offsets": [at, at + 12]});
        data.drain(at + 12..at + 12 + spare);
        for (other, entry) in header.as_object_mut().unwrap() {
            if other != name && other != "__metadata__" && entry["data_offsets"][0].as_u64().unwrap() as usize > at {
                let moved = |i: usize| entry["data_offsets"][i].as_u64().unwrap() - spare as u64;
                entry["data_offsets"] = json!([moved(0), moved(1)]);
            }
        }
    });
    for bad in [half_bits(0x7c00), half_bits(0xfe01)] {
        for name in [MODES, "regressor.gru.w_hh"] {
            refused(Precision::F16, "is not finite", |header, data| {
                data[start(header, name)..][..2].copy_from_slice(&bad);
            });
        }
    }
    // A flipped byte of the modes is no longer what the self-check saw.
    refused(Precision::I8, "self-check", |header, data| data[start(header, MODES) + 40] ^= 0x40);
}

fn half_bits(bits: u16) -> [u8; 2] {
    bits.to_le_bytes()
}

#[test]
fn files_shrink_with_the_bits() {
    let size = |precision| {
        let dir = tempfile::tempdir().unwrap();
        bundle(Parts::default()).reduced(precision).unwrap().write(dir.path()).unwrap();
        let bytes = std::fs::read(dir.path().join("model.safetensors")).unwrap();
        let n = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        let header: Value = serde_json::from_slice(&bytes[8..8 + n]).unwrap();
        let bytes = |name: &str| {
            let range = &header[name]["data_offsets"];
            range[1].as_u64().unwrap() - range[0].as_u64().unwrap()
        };
        (bytes("basis.directions"), bytes("regressor.gru.w_ih"))
    };
    let [whole, half, byte] = Precision::ALL.map(size);
    assert_eq!((2 * half.0, 2 * half.1), whole);
    // All seven modes are among those that have two bytes.
    assert_eq!((byte.0, byte.1), (half.0, half.1));
}
