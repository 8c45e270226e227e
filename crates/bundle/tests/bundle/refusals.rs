//! Bad input 65: bundles that must be refused with one sentence, however they came to be.

use crate::tiny::{Parts, bundle};
use serde_json::{Value, json};
use softtissue_bundle::*;
use softtissue_store::sha256_bytes;
use std::path::{Path, PathBuf};

const MODEL: &str = "model.safetensors";

/// A good bundle in a folder of its own.
fn good() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    bundle(Parts::default()).write(dir.path()).unwrap();
    dir
}

/// Reads; must be refused in one line that names the file and says `says`.
fn refuse(dir: &Path, says: &str) {
    let error = Bundle::read(dir).expect_err(says);
    let message = error.to_string();
    assert!(message.contains(says) && !message.contains('\n'), "expected {says:?} in: {message}");
    assert!(message.contains(dir.to_str().unwrap()), "names no file: {message}");
}

fn manifest_of(dir: &Path) -> (PathBuf, Value) {
    let path = dir.join(MANIFEST_FILE);
    let value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    (path, value)
}

fn edit_manifest(dir: &Path, edit: impl FnOnce(&mut Value)) {
    let (path, mut value) = manifest_of(dir);
    edit(&mut value);
    std::fs::write(path, value.to_string()).unwrap();
}

/// Replaces the model and makes the manifest's size and hash fit, as a forger would.
fn forge_model(dir: &Path, bytes: &[u8]) {
    std::fs::write(dir.join(MODEL), bytes).unwrap();
    edit_manifest(dir, |m| {
        m["files"][1]["bytes"] = json!(bytes.len());
        m["files"][1]["sha256"] = json!(sha256_bytes(bytes));
    });
}

/// The model's header and data.
fn split(bytes: &[u8]) -> (Value, Vec<u8>) {
    let n = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    (serde_json::from_slice(&bytes[8..8 + n]).unwrap(), bytes[8 + n..].to_vec())
}

fn join(header: &str, data: &[u8]) -> Vec<u8> {
    [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), data].concat()
}

/// Forges the model's header and data.
fn forge(dir: &Path, edit: impl FnOnce(&mut Value, &mut Vec<u8>)) {
    let (mut header, mut data) = split(&std::fs::read(dir.join(MODEL)).unwrap());
    edit(&mut header, &mut data);
    forge_model(dir, &join(&header.to_string(), &data));
}

/// Where an array's bytes begin.
fn start(header: &Value, name: &str) -> usize {
    header[name]["data_offsets"][0].as_u64().unwrap() as usize
}

#[test]
fn a_descriptor_of_other_arrays() {
    let dir = good();
    edit_manifest(dir.path(), |m| m["descriptor"]["modes"] = json!(9));
    refuse(dir.path(), "9 modes");
}

/// What a terminal would take for a command is not repeated to it.
#[test]
fn a_key_of_control_characters() {
    let dir = good();
    edit_manifest(dir.path(), |m| m["\u{1b}[2J"] = json!(1));
    refuse(dir.path(), "[2J");
    assert!(!Bundle::read(dir.path()).unwrap_err().to_string().contains(char::is_control));
    for place in ["/topology", "/files/0/sha256"] {
        let dir = good();
        edit_manifest(dir.path(), |m| *m.pointer_mut(place).unwrap() = json!("\u{1b}[2J"));
        assert!(!Bundle::read(dir.path()).unwrap_err().to_string().contains(char::is_control), "{place}");
    }
}

#[test]
fn a_newer_version() {
    let dir = good();
    edit_manifest(dir.path(), |m| {
        m["version"] = json!(FORMAT_VERSION + 1);
        m["something_new"] = json!([1, 2]);
    });
    let newer = Bundle::read(dir.path());
    assert!(
        matches!(newer, Err(BundleError::Newer { found, supported: FORMAT_VERSION, .. }) if found == FORMAT_VERSION + 1)
    );
    refuse(dir.path(), "update the program");
    edit_manifest(dir.path(), |m| m["version"] = json!(1));
    refuse(dir.path(), "train again");
    // Version 5 knew nobody.
    let dir = good();
    edit_manifest(dir.path(), |m| {
        m["version"] = json!(5);
        m["model"].as_object_mut().unwrap().remove("acquaintance").unwrap();
    });
    assert!(Bundle::read(dir.path()).unwrap().model.recurrent().unwrap().regressor.acquaintance.is_none());
}

#[test]
fn another_format_units_axis_or_precision() {
    for (key, value, says) in [
        ("format", json!("onnx"), "format"),
        ("format", json!("softtissue-avatar"), "no real-time player runs"),
        ("units", json!("inch"), "units"),
        ("up_axis", json!("+Z"), "up axis"),
        ("precision", json!("i4"), "precision"),
        ("precision", json!("f16"), "expected F16"),
        ("fps", json!(30.0), "rate"),
        ("fps", json!(null), "fps"),
        ("unknown_key", json!(1), "unknown"),
        ("joints", json!(["root", "top", "middle"]), "joints"),
    ] {
        let dir = good();
        edit_manifest(dir.path(), |m| {
            if key == "fps" {
                m["descriptor"]["look_ahead"] = json!(0);
            }
            m[key] = value;
        });
        let message = Bundle::read(dir.path()).unwrap_err().to_string();
        assert!(message.contains(says) || key == "fps" && message.contains("null"), "{key}: {message}");
    }
}

#[test]
fn another_topology() {
    let dir = good();
    edit_manifest(dir.path(), |m| m["topology"] = json!("0011223344556677"));
    assert!(matches!(Bundle::read(dir.path()), Err(BundleError::Topology { .. })));
    refuse(dir.path(), "0011223344556677");
}

#[test]
fn a_flipped_bit_a_truncated_and_a_longer_file() {
    for file in [MODEL, "body.safetensors"] {
        let dir = good();
        let path = dir.path().join(file);
        let bytes = std::fs::read(&path).unwrap();
        let mut flipped = bytes.clone();
        flipped[bytes.len() / 2] ^= 1;
        std::fs::write(&path, &flipped).unwrap();
        assert!(matches!(Bundle::read(dir.path()), Err(BundleError::Hash { .. })));
        refuse(dir.path(), "damaged");
        for changed in [&bytes[..bytes.len() - 1], &[&bytes[..], b"x"].concat(), b""] {
            std::fs::write(&path, changed).unwrap();
            refuse(dir.path(), "bytes");
        }
        std::fs::remove_file(&path).unwrap();
        refuse(dir.path(), "does not exist");
    }
}

#[test]
fn a_forged_truncation_or_tail() {
    let dir = good();
    let bytes = std::fs::read(dir.path().join(MODEL)).unwrap();
    for n in [0, 7, 8, 100, bytes.len() - 4] {
        forge_model(dir.path(), &bytes[..n]);
        refuse(dir.path(), MODEL);
    }
    forge_model(dir.path(), &[&bytes[..], &[0; 4]].concat());
    refuse(dir.path(), "behind the end");
    let mut long = bytes.clone();
    long[..8].copy_from_slice(&u64::MAX.to_le_bytes());
    forge_model(dir.path(), &long);
    refuse(dir.path(), "claims");
}

#[test]
fn overlapping_offsets_and_duplicate_keys() {
    let dir = good();
    forge(dir.path(), |header, _| {
        let other = header["regressor.shape.lower"]["data_offsets"].clone();
        header["regressor.shape.upper"]["data_offsets"] = other;
    });
    refuse(dir.path(), "overlap");
    let dir = good();
    let (header, data) = split(&std::fs::read(dir.path().join(MODEL)).unwrap());
    let twice = header.to_string().replacen('{', &format!("{{\"basis.mean\":{},", header["basis.mean"]), 1);
    forge_model(dir.path(), &join(&twice, &data));
    refuse(dir.path(), "twice");
    // In the manifest too.
    let dir = good();
    let path = dir.path().join(MANIFEST_FILE);
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, text.replacen('{', "{\"topology\": \"0\",", 1)).unwrap();
    refuse(dir.path(), "duplicate");
}

#[test]
fn a_million_tensors() {
    for count in [1_000_000, 4_000] {
        let dir = good();
        let entry = r#"{"dtype":"F32","shape":[0],"data_offsets":[0,0]}"#;
        let header: Vec<String> = (0..count).map(|i| format!("\"t{i}\":{entry}")).collect();
        forge_model(dir.path(), &join(&format!("{{{}}}", header.join(",")), &[]));
        refuse(dir.path(), if count > 10_000 { "claims" } else { "at most 1024" });
    }
}

#[test]
fn not_a_number_anywhere() {
    let dir = good();
    let (header, data) = split(&std::fs::read(dir.path().join(MODEL)).unwrap());
    let floats = header.as_object().unwrap().iter().filter(|(_, e)| e["dtype"] == "F32");
    for name in floats.map(|(name, _)| name) {
        for bad in [f32::NAN, f32::INFINITY] {
            let mut data = data.clone();
            let at = start(&header, name);
            data[at..at + 4].copy_from_slice(&bad.to_le_bytes());
            forge_model(dir.path(), &join(&header.to_string(), &data));
            refuse(dir.path(), name);
        }
    }
}

#[test]
fn missing_unknown_and_misshapen_arrays() {
    let dir = good();
    forge(dir.path(), |header, _| {
        let moved = header.as_object_mut().unwrap().remove("regressor.gru.b_hh").unwrap();
        header["regressor.gru.c_hh"] = moved;
    });
    refuse(dir.path(), "\"regressor.gru.b_hh\" is missing");
    let dir = good();
    edit_manifest(dir.path(), |m| m["model"]["recurrent"] = json!(false));
    refuse(dir.path(), "unknown array");
    let dir = good();
    edit_manifest(dir.path(), |m| m["model"]["decoder_units"] = json!(1u64 << 60));
    refuse(dir.path(), "residual units");
    let dir = good();
    edit_manifest(dir.path(), |m| m["model"]["bank"]["channels"] = json!(u64::MAX));
    refuse(dir.path(), "resonators");
    let dir = good();
    edit_manifest(dir.path(), |m| m["model"]["bank"]["resonators"][0]["damping"] = json!(-0.1));
    refuse(dir.path(), "not stable");
    let dir = good();
    edit_manifest(dir.path(), |m| m["model"]["bank"]["hardening"]["floor"] = json!(0.0));
    refuse(dir.path(), "law of hardening");
    for (key, value) in [
        ("direct", json!(false)),
        ("shape_terms", json!([[], [0, 1]])),
        ("shape_terms", json!([[], [0, 1], [0, 0, 1]])),
        ("shape_terms", json!([[], [0, 1], [0, 200]])),
        ("mass", json!({"frequency": 40.0, "amplitude": 0.0, "centre": 0.0, "range": [0.0, 1.0]})),
        ("features", json!(3)),
        ("beta_count", json!(1)),
        ("beta_count", json!(1u64 << 60)),
        ("features", json!(1u64 << 60)),
        ("bank", json!(null)),
    ] {
        let dir = good();
        edit_manifest(dir.path(), |m| m["model"][key] = value.clone());
        let message = Bundle::read(dir.path()).expect_err(key).to_string();
        assert!(message.contains("export it again") || message.contains("feature scaling"), "{key}: {message}");
    }
    // Each array with its two axes exchanged.
    let dir = good();
    let (header, data) = split(&std::fs::read(dir.path().join(MODEL)).unwrap());
    for (name, entry) in header.as_object().unwrap() {
        let shape: Vec<u64> = serde_json::from_value(entry["shape"].clone()).unwrap_or_default();
        if shape.len() == 2 && shape[0] != shape[1] {
            let mut header = header.clone();
            header[name]["shape"] = json!([shape[1], shape[0]]);
            forge_model(dir.path(), &join(&header.to_string(), &data));
            assert!(Bundle::read(dir.path()).is_err(), "{name}");
        }
    }
}

#[test]
fn a_file_outside() {
    for name in ["../model.safetensors", "/etc/passwd", "model.safetensors/../x", "other.safetensors", ""] {
        let dir = good();
        edit_manifest(dir.path(), |m| m["files"][1]["name"] = json!(name));
        refuse(dir.path(), "no file of a bundle");
    }
    let dir = good();
    edit_manifest(dir.path(), |m| {
        let first = m["files"][0].clone();
        m["files"].as_array_mut().unwrap().push(first);
    });
    refuse(dir.path(), "expected body.safetensors");
    #[cfg(unix)]
    {
        let (dir, elsewhere) = (good(), good());
        std::fs::remove_file(dir.path().join(MODEL)).unwrap();
        std::os::unix::fs::symlink(elsewhere.path().join(MODEL), dir.path().join(MODEL)).unwrap();
        refuse(dir.path(), "out of the bundle's folder");
    }
}

#[test]
fn another_output_than_recorded() {
    let dir = good();
    forge(dir.path(), |header, data| {
        // One weight of the decoder, changed by a plausible amount.
        let at = start(header, "decoder.lift.weight");
        let weight = f32::from_le_bytes(data[at..at + 4].try_into().unwrap());
        data[at..at + 4].copy_from_slice(&(weight + 0.3).to_le_bytes());
    });
    assert!(matches!(Bundle::read(dir.path()), Err(BundleError::SelfCheck { .. })));
    refuse(dir.path(), "self-check");
}

#[test]
fn no_bundle_at_all() {
    let dir = tempfile::tempdir().unwrap();
    refuse(dir.path(), "does not exist");
    for text in ["", "{", "[]", "{\"format\": 3}", &"[".repeat(100_000)] {
        std::fs::write(dir.path().join(MANIFEST_FILE), text).unwrap();
        refuse(dir.path(), MANIFEST_FILE);
    }
}

#[test]
fn a_bundle_in_memory_is_checked_like_one_on_disk() {
    let dir = tempfile::tempdir().unwrap();
    let bundle = bundle(Parts::default());
    bundle.write(dir.path()).unwrap();
    let file = |name: &str| std::fs::read(dir.path().join(name)).unwrap();
    let files = BundleFiles {
        manifest: file("manifest.json"),
        body: file("body.safetensors"),
        model: file("model.safetensors"),
    };
    let read = Bundle::from_memory(files.clone()).unwrap();
    assert!(read.model == bundle.model && read.info == bundle.info && read.self_check == bundle.self_check);
    let refused = |change: &dyn Fn(&mut BundleFiles), says: &str| {
        let mut files = files.clone();
        change(&mut files);
        let message = Bundle::from_memory(files).unwrap_err().to_string();
        assert!(message.contains(says), "{says:?} is missing in: {message}");
    };
    refused(&|f| *f.model.last_mut().unwrap() ^= 1, "model.safetensors");
    refused(&|f| f.body.truncate(1000), "body.safetensors is not usable: it has 1000 bytes");
    refused(&|f| f.body.clear(), "body.safetensors");
    refused(&|f| f.manifest.truncate(100), "manifest.json");
    refused(&|f| std::mem::swap(&mut f.body, &mut f.model), "body.safetensors");
}
