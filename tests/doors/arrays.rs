//! Cases 39 to 49: NumPy's arrays and archives, HDF5, pickles.

use super::files::{Lay, came_in, fixture, frame, junk, npy, vertices, zip};
use super::{Case, Door, Then};
use softtissue_clips::ScanSet;
use std::path::Path;

/// An archive of scans whose vertices are this npy file.
fn scans(number: u8, name: &str, array: &[u8], words: &[&'static str]) -> Case {
    Case::refused(number, Door::Scans, name, zip(&[("vertices.npy", array)]), &[&["array vertices"], words].concat())
}

/// A body whose template is this npy file.
fn body(number: u8, name: &str, array: &[u8], words: &[&'static str]) -> Case {
    Case::refused(number, Door::Body, name, zip(&[("v_template.npy", array)]), &[&["array v_template"], words].concat())
}

fn amass(number: u8, file: &str, words: &[&'static str]) -> Case {
    Case::fixture(number, Door::Motion, &format!("motion/{file}"), file, words)
}

fn hdf5(number: u8, file: &str, words: &[&'static str]) -> Case {
    Case::fixture(number, Door::Scans, &format!("scans/{file}"), file, words)
}

fn pickle(name: &str, bytes: &[u8], words: &[&'static str]) -> Case {
    Case::refused(49, Door::Body, name, bytes, words)
}

pub fn cases() -> Vec<Case> {
    let mut cases = heads();
    cases.extend(types());
    cases.extend(archives());
    cases.extend(containers());
    cases.extend(pickles());
    cases
}

/// 39 to 41.
fn heads() -> Vec<Case> {
    let long = b"\x93NUMPY\x02\0\xff\xff\xff\xff{'descr'";
    let overflow = npy("<f8", false, "(4294967296, 4294967296)", &[0; 24]);
    let empty_rows = npy("<f8", false, "(1000000000000000000, 0, 3)", &[]);
    let whole = vertices(&[frame(0), frame(1)]);
    let cut = &whole[..whole.len() - 8];
    let template = npy("<f8", false, "(9, 3)", &[0; 200]);
    vec![
        scans(39, "anna_long.npz", long, &["4294967295"]),
        amass(39, "bad_header.npz", &["array trans", "4294967295"]),
        body(39, "long.npz", long, &["4294967295"]),
        scans(40, "anna_overflow.npz", &overflow, &["4294967296", "asks for more"]),
        scans(40, "anna_rows.npz", &empty_rows, &["1000000000000000000", "asks for more"]),
        amass(40, "bad_overflow.npz", &["array trans", "4294967296"]),
        body(40, "overflow.npz", &overflow, &["4294967296", "asks for more"]),
        scans(41, "anna_cut.npz", cut, &["it holds 41368"]),
        scans(41, "anna_half.npz", &whole[..60], &["cut off"]),
        amass(41, "bad_cut.npz", &["array trans", "280"]),
        body(41, "cut.npz", &template, &["it holds 200"]),
        Case::fixture(41, Door::Body, "bodies/short.npz", "short.npz", &["weights", "[37, 24]", "[38, any]"]),
        Case::fixture(41, Door::Body, "arrays/plain.npy", "plain.npy", &["neither a pickle nor an npz"]),
    ]
}

/// 42 and 43.
fn types() -> Vec<Case> {
    let objects = npy("|O", false, "(2, 1724, 3)", b"\x80\x02]q\0.");
    let records = npy("<c16", false, "(2, 1724, 3)", &[0; 64]);
    // `f8`, big-endian, first index fastest.
    let frames = [frame(0), frame(1)];
    let numbers = (0..3).flat_map(|axis| (0..1724).flat_map(move |v| (0..2).map(move |t| (t, v, axis))));
    let turned: Vec<u8> = numbers.flat_map(|(t, v, axis)| f64::from(frames[t][v][axis]).to_be_bytes()).collect();
    let turned = zip(&[("verts.npy", &npy(">f8", true, "(2, 1724, 3)", &turned))]);
    let second = std::fs::read(fixture("motion/amass_2.npz")).expect("a fixture");
    let came = |out: &Path| {
        let set = ScanSet::open(out).expect("a set");
        assert_eq!(set.ids()[0].to_string(), "anna/hips.0");
        came_in(out);
    };
    vec![
        scans(42, "anna_objects.npz", &objects, &["Python objects"]),
        scans(42, "anna_complex.npz", &records, &["<c16", "not read"]),
        amass(42, "bad_object.npz", &["array poses", "numbers"]),
        Case::fixture(42, Door::Body, "bodies/objects.npz", "objects.npz", &["weights", "no array"]),
        Case::new(
            43,
            Door::Scans,
            "anna_hips.npz",
            vec![Lay::Bytes("anna_hips.npz".into(), turned)],
            Then::Fine(vec!["1 clips"], came),
        ),
        // `f4`, `>f8` and Fortran's order in one archive.
        Case::new(
            43,
            Door::Motion,
            "second.npz",
            vec![Lay::Bytes("second.npz".into(), second)],
            Then::Fine(vec!["AMASS", "12 frames"], |_| ()),
        ),
    ]
}

/// 44 and 45.
fn archives() -> Vec<Case> {
    let mut cases = Vec::new();
    for (file, words) in [("twice", &["poses.npy", "twice"]), ("outside", &["../poses.npy", "not trusted"])] {
        let from = format!("arrays/{file}.npz");
        cases.push(Case::fixture(44, Door::Scans, &from, &format!("anna_{file}.npz"), words));
        cases.push(Case::fixture(44, Door::Motion, &from, &format!("{file}.npz"), words));
        cases.push(Case::fixture(44, Door::Body, &from, &format!("{file}-body.npz"), words));
    }
    let line = zip(&[("vertices\n.npy", &[])]);
    cases.push(Case::refused(44, Door::Scans, "anna_line.npz", line, &["no file's"]));
    let other = std::fs::read(fixture("motion/bad_bomb.npz")).expect("a fixture");
    // The bomb goes off where its array is asked for: a body has one of this name, scans have not.
    let bomb = |from: &[u8], to: &[u8]| -> Vec<u8> {
        let mut bytes = other.clone();
        for at in 0..bytes.len() - from.len() {
            if bytes[at..].starts_with(from) {
                bytes[at..at + from.len()].copy_from_slice(to);
            }
        }
        bytes
    };
    cases.push(amass(45, "bad_bomb.npz", &["member poses.npy", "inflate"]));
    let verts = bomb(b"poses.npy", b"verts.npy");
    cases.push(Case::refused(45, Door::Scans, "anna_bomb.npz", verts, &["member verts.npy", "inflate"]));
    cases.push(Case::fixture(44, Door::Body, "arrays/stored.npz", "stored.npz", &["v_template", "missing"]));
    cases.push(Case::fixture(44, Door::Scans, "scans/anna_nothing.npz", "anna_nothing.npz", &["no array `vertices`"]));
    cases
}

/// 46 to 48.
fn containers() -> Vec<Case> {
    let whole = std::fs::read(fixture("scans/dfaust.hdf5")).expect("a fixture");
    let half = whole[..whole.len() / 2].to_vec();
    vec![
        hdf5(46, "external_storage.hdf5", &["50004_hips", "inside this file"]),
        hdf5(46, "virtual.hdf5", &["50004_hips"]),
        hdf5(46, "external_link.hdf5", &["its root lists no dataset"]),
        hdf5(47, "bomb.hdf5", &["50004_hips", "no scan does"]),
        hdf5(47, "vast.hdf5", &["50004_hips", "more than"]),
        hdf5(48, "cyclic.hdf5", &["its root lists no dataset"]),
        hdf5(48, "nameless.hdf5", &["dataset hips", "SUBJECT_SEQUENCE"]),
        hdf5(48, "two_axes.hdf5", &["50004_hips", "(vertices, 3, frames)"]),
        Case::refused(48, Door::Scans, "half.hdf5", half, &["HDF5"]),
    ]
}

/// 49.
fn pickles() -> Vec<Case> {
    let whole = std::fs::read(fixture("bodies/smpl.pkl")).expect("a fixture");
    let deep = [&b"\x80\x02"[..], &b"]".repeat(1_000_000), &b"a".repeat(999_999), b"."].concat();
    let endless = [&b"\x80\x02"[..], &b"(".repeat(3_000_000)].concat();
    // A list that grows without new objects, and one long key that stands in a dictionary a million times.
    let grows = [&b"\x80\x02]q\0N"[..], &b"0h\0h\0a".repeat(2_100_000)].concat();
    let key = [&b"T\0\0\x40\0"[..], &[b'k'; 0x40_0000], b"q\x01"].concat();
    let keys = [&b"\x80\x02}("[..], &key, b"N", &b"h\x01N".repeat(900_000), b"u."].concat();
    let huge = b"\x80\x02}U\x0av_templatecnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R(K\x01\
        \x8a\x05\x00\x00\x00\x00\x7f\x8a\x05\x00\x00\x00\x00\x7f\x86cnumpy\ndtype\nU\x02f8K\x00K\x01\x87R(K\x03U\x01<NNNJ\
        \xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb\x89U\x00tbs.";
    let inside =
        zip(&[("v_template.npy", &npy("|O", false, "()", &[&b"\x80\x02"[..], &b"(".repeat(3_000_000)].concat()))]);
    vec![
        pickle("deep.pkl", &deep, &["v_template", "missing"]),
        pickle("endless.pkl", &endless, &["more than", "objects"]),
        pickle("grows.pkl", &grows, &["more than", "objects"]),
        pickle("keys.pkl", &keys, &["v_template", "missing"]),
        pickle("cyclic.pkl", b"\x80\x02}q\x00U\x0av_templateh\x00s.", &["v_template", "no array"]),
        pickle("half.pkl", &whole[..whole.len() / 2], &["cut off", "byte"]),
        // What a pickle would run stays a name: had it run, it would take longer than there is time.
        pickle("runs.pkl", b"\x80\x02cos\nsystem\nU\x08sleep 99\x85R.", &["v_template", "missing"]),
        pickle("huge.pkl", huge, &["v_template", "asks for more than"]),
        pickle("noise.pkl", &[b"\x80\x02", &junk()[..]].concat(), &["byte"]),
        Case::refused(49, Door::Body, "inside.npz", inside, &["array v_template", "objects"]),
        Case::fixture(49, Door::Body, "arrays/protocol2.pkl", "protocol2.pkl", &["v_template", "missing"]),
    ]
}
