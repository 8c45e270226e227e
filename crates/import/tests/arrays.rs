//! NumPy's files, as NumPy wrote them (`tests/fixtures/arrays/make.py`), and damaged ones.

use proptest::prelude::*;
use softtissue_import::Place;
use softtissue_import::arrays::{Array, ArrayLimits, Npz, read_npy};
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> PathBuf {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fixtures/arrays")).join(name)
}

fn open(name: &str) -> Npz {
    Npz::open(&fixture(name), &ArrayLimits::default()).unwrap()
}

#[test]
fn every_type_order_and_compression() {
    let table: Vec<f64> = (0..12).map(|i| f64::from(i) - 1.5).collect();
    for file in ["stored.npz", "deflated.npz"] {
        let npz = open(file);
        for name in ["f8", "f4_big_endian", "f2"] {
            let array = npz.require(name).unwrap();
            array.expect_shape(&[Some(3), None]).unwrap();
            assert_eq!(array.f64s().unwrap(), table, "{file} {name}");
        }
        let fortran = npz.require("f8_fortran").unwrap();
        assert_eq!(fortran.shape(), [2, 3, 4]);
        assert_eq!(fortran.f32s().unwrap(), (0..24).map(|i| i as f32).collect::<Vec<_>>());
        assert_eq!(npz.require("i4").unwrap().integers().unwrap(), [-2, 7]);
        assert_eq!(npz.require("u4").unwrap().integers().unwrap(), [0, 4_294_967_295]);
        assert_eq!(npz.require("bool").unwrap().integers().unwrap(), [1, 0]);
        assert_eq!(npz.require("rate").unwrap().number().unwrap(), 120.00005);
        assert_eq!(npz.require("unicode").unwrap().text().unwrap(), "female");
        assert_eq!(npz.require("bytes").unwrap().text().unwrap(), "female");
        assert_eq!(npz.require("names").unwrap().texts().unwrap(), ["hips", "spine", "häfte"]);
        assert!(npz.require("empty").unwrap().f32s().unwrap().is_empty());
    }
    assert_eq!(read_npy(&fixture("plain.npy"), &ArrayLimits::default()).unwrap().f64s().unwrap(), table);
}

#[test]
fn what_is_not_asked_for_is_refused_with_its_place() {
    let npz = open("stored.npz");
    let says = |outcome: String, words: &[&str]| {
        assert!(words.iter().all(|w| outcome.contains(w)) && outcome.contains("stored.npz"), "{outcome}");
    };
    let array = |name: &str| npz.require(name).unwrap();
    says(array("nan").f32s().unwrap_err().to_string(), &["array nan", "[1, 0]", "not finite"]);
    says(array("huge").f32s().unwrap_err().to_string(), &["[0]", "range"]);
    says(array("fraction").integers().unwrap_err().to_string(), &["[1]", "whole number"]);
    says(array("object").f64s().unwrap_err().to_string(), &["Python objects"]);
    says(array("unicode").f64s().unwrap_err().to_string(), &["text"]);
    says(array("f8").text().unwrap_err().to_string(), &["no text"]);
    says(array("f8").number().unwrap_err().to_string(), &["[3, 4]", "single"]);
    says(array("f8").expect_shape(&[None, Some(3)]).unwrap_err().to_string(), &["[any, 3]"]);
    says(npz.require("poses").err().unwrap().to_string(), &["missing", "f8_fortran"]);
    assert!(npz.get("poses").unwrap().is_none());
}

#[test]
fn hostile_archives_are_refused() {
    let limits = ArrayLimits::default();
    let opening = |name: &str| Npz::open(&fixture(name), &limits).err().unwrap().to_string();
    assert!(opening("twice.npz").contains("stands twice"));
    assert!(opening("outside.npz").contains("leads out"));
    assert!(opening("plain.npy").contains("no zip archive"));
    // 32 MiB of zeros in 32 KiB.
    let bomb = open("bomb.npz").require("poses").err().unwrap().to_string();
    assert!(bomb.contains("inflate") && bomb.contains("member poses.npy"), "{bomb}");
    let small = ArrayLimits { array_bytes: 64, ..limits };
    let large = Npz::open(&fixture("stored.npz"), &small).unwrap().require("f8").err().unwrap();
    assert!(large.to_string().contains("more than 64"), "{large}");
}

/// Small numbers become eight bytes each, and a text of none is still a text.
#[test]
fn what_would_outgrow_the_limit_in_memory_is_refused() {
    let limits = ArrayLimits { array_bytes: 64, ..ArrayLimits::default() };
    let array = |descr: &str, count: usize, data: &[u8]| {
        let head = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({count},)}}");
        let length = (head.len() as u16).to_le_bytes();
        let bytes = [&b"\x93NUMPY\x01\0"[..], &length, head.as_bytes(), data].concat();
        Array::from_npy(Place::file(Path::new("a.npy")), bytes, &limits).unwrap()
    };
    assert_eq!(array("|u1", 8, &[1; 8]).f64s().unwrap(), [1.0; 8]);
    let refused = |outcome: String| assert!(outcome.contains("more than 64 bytes in memory"), "{outcome}");
    refused(array("|u1", 9, &[1; 9]).f64s().unwrap_err().to_string());
    refused(array("|u1", 9, &[1; 9]).integers().unwrap_err().to_string());
    refused(array("|S0", 9, &[]).texts().unwrap_err().to_string());
    assert!(array("|u1", 9, &[1; 9]).number().unwrap_err().to_string().contains("single number"));
}

#[test]
fn truncated_and_padded_arrays_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.npy");
    let bytes = std::fs::read(fixture("plain.npy")).unwrap();
    let limits = ArrayLimits::default();
    for n in [0, 5, 9, 60, 128, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..n]).unwrap();
        assert!(read_npy(&path, &limits).err().unwrap().to_string().contains("a.npy"), "{n}");
    }
    std::fs::write(&path, [&bytes[..], b"x"].concat()).unwrap();
    assert!(read_npy(&path, &limits).err().unwrap().to_string().contains("it holds 97"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..ProptestConfig::default() })]

    /// Whatever bytes change, reading ends in arrays or in a sentence.
    #[test]
    fn damaged_archives_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        cut in any::<prop::sample::Index>(),
        truncated in any::<bool>(),
        compressed in any::<bool>(),
    ) {
        let mut bytes = std::fs::read(fixture(if compressed { "deflated.npz" } else { "stored.npz" })).unwrap();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if truncated {
            bytes.truncate(cut.index(bytes.len()));
        }
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.npz");
        std::fs::write(&path, bytes).unwrap();
        if let Ok(npz) = Npz::open(&path, &ArrayLimits::default()) {
            for name in npz.names() {
                if let Ok(array) = npz.require(name) {
                    let _ = (array.f64s(), array.integers(), array.texts());
                }
            }
        }
    }
}
