//! Files that cases are made of: frames of the body's own template, so that nothing but the fault is wrong with them.

use crate::support::{data_dir, softtissue};
use softtissue_body::BodyModel;
use softtissue_clips::ScanSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// A point.
pub type P = [f32; 3];

/// Something that lies in the folder of a case.
pub enum Lay {
    /// A file.
    Bytes(String, Vec<u8>),
    /// A folder.
    Folder(String),
    /// A pipe that nobody writes to.
    Pipe(String),
}

impl Lay {
    /// Lays it down below a folder.
    pub fn down(&self, home: &Path) {
        let (Self::Bytes(name, _) | Self::Folder(name) | Self::Pipe(name)) = self;
        let path = home.join(name);
        std::fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        match self {
            Self::Bytes(_, bytes) => std::fs::write(path, bytes).expect("a file"),
            Self::Folder(_) => std::fs::create_dir_all(path).expect("a folder"),
            Self::Pipe(_) => assert!(Command::new("mkfifo").arg(path).status().expect("mkfifo").success()),
        }
    }
}

/// A file that Python made.
pub fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures").join(name)
}

/// A cut of a real take.
pub fn take(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/motion").join(name);
    std::fs::read_to_string(path).expect("a take")
}

/// The body that scans must match, as the command makes and keeps it.
pub fn body() -> &'static BodyModel {
    static BODY: OnceLock<BodyModel> = OnceLock::new();
    BODY.get_or_init(|| {
        let (home, data) = (data_dir().join("no-scans"), data_dir().display().to_string());
        std::fs::create_dir_all(&home).expect("a folder");
        let home = home.display().to_string();
        softtissue(&["import", "scans", &home, "--out", "/proc/none", "--data-dir", &data]).refused(3, &["no scan"]);
        let kept = std::fs::read_dir(data_dir().join("cache")).expect("a cache").flatten().map(|e| e.path());
        let bodies = kept.filter(|p| p.file_name().is_some_and(|n| n.to_string_lossy().starts_with("body-")));
        let mut models = bodies.filter_map(|p| BodyModel::read(&p).ok()).filter(|b| b.vertex_count() == 1724);
        models.next().expect("the body that was made")
    })
}

/// The template, a little further on in each frame.
pub fn frame(t: usize) -> Vec<P> {
    body().template.iter().map(|p| [p.x + 0.01 * t as f32, p.y, p.z]).collect()
}

/// Triangles of the template.
pub fn faces() -> Vec<[u32; 3]> {
    body().topology.faces.clone()
}

/// An OBJ file.
pub fn obj(points: &[P], faces: &[[u32; 3]]) -> String {
    let mut text = String::new();
    points.iter().for_each(|p| writeln!(text, "v {} {} {}", p[0], p[1], p[2]).expect("a line"));
    faces.iter().for_each(|f| writeln!(text, "f {} {} {}", f[0] + 1, f[1] + 1, f[2] + 1).expect("a line"));
    text
}

/// A PLY file, big-endian.
pub fn ply(points: &[P]) -> Vec<u8> {
    let properties = "property float x\nproperty float y\nproperty float z\n";
    let head = format!("ply\nformat binary_big_endian 1.0\nelement vertex {}\n{properties}end_header\n", points.len());
    let mut bytes = head.into_bytes();
    points.iter().flatten().for_each(|x| bytes.extend(x.to_be_bytes()));
    bytes
}

/// A PLY file in ascii with some faces, each written as it stands.
pub fn ascii_ply(points: &[P], faces: &[&str]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\nproperty double z\nelement face {}\n\
         property list int int vertex_indices\nend_header\n",
        points.len(),
        faces.len()
    );
    points.iter().for_each(|p| writeln!(text, "{} {} {}", p[0], p[1], p[2]).expect("a line"));
    faces.iter().for_each(|f| writeln!(text, "{f}").expect("a line"));
    text
}

/// Bytes with the first `from` in them replaced.
pub fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|w| w == from).expect("what is replaced");
    [&bytes[..at], to, &bytes[at + from.len()..]].concat()
}

/// An npy file of a type, shape and data, all as stated.
pub fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let head = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    let length = (head.len() as u16).to_le_bytes();
    [&b"\x93NUMPY\x01\0"[..], &length, head.as_bytes(), data].concat()
}

/// An npy file of frames `(T, V, 3)`.
pub fn vertices(frames: &[Vec<P>]) -> Vec<u8> {
    let data: Vec<u8> = frames.iter().flatten().flatten().flat_map(|x| x.to_le_bytes()).collect();
    npy("<f4", false, &format!("({}, {}, 3)", frames.len(), frames.first().map_or(0, Vec::len)), &data)
}

/// A stored zip archive.
pub fn zip(members: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut zip, mut list) = (Vec::new(), Vec::new());
    for (name, body) in members {
        let at = (zip.len() as u32).to_le_bytes();
        let size = (body.len() as u32).to_le_bytes();
        let name_length = (name.len() as u16).to_le_bytes();
        // Version, flags, method, time and date, checksum, sizes, length of the name, no extra field.
        let facts =
            [&[20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0][..], &crc32(body).to_le_bytes(), &size, &size, &name_length, &[0, 0]]
                .concat();
        zip.extend([&b"PK\x03\x04"[..], &facts, name.as_bytes(), body].concat());
        list.extend([&b"PK\x01\x02\x14\0"[..], &facts, &[0; 10], &at, name.as_bytes()].concat());
    }
    let (count, at) = ((members.len() as u16).to_le_bytes(), (zip.len() as u32).to_le_bytes());
    let size = (list.len() as u32).to_le_bytes();
    [&zip[..], &list, b"PK\x05\x06\0\0\0\0", &count, &count, &size, &at, &[0, 0]].concat()
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |c, _| if c & 1 == 1 { (c >> 1) ^ 0xedb8_8320 } else { c >> 1 })
    })
}

/// Bytes without a meaning.
pub fn junk() -> Vec<u8> {
    (0..100_000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 13) as u8).collect()
}

/// Frames of the clip `anna/hips`.
pub fn clip(source: &str, frames: Vec<(&str, Vec<u8>)>) -> Vec<Lay> {
    let lay = |(name, bytes): (&str, Vec<u8>)| Lay::Bytes(format!("{source}/anna/hips/{name}"), bytes);
    let mut all: Vec<Lay> = frames.into_iter().map(lay).collect();
    all.push(Lay::Folder(format!("{source}/anna/hips")));
    all
}

/// Whether the clip `anna/hips` came in as [`frame`] 0, 1, ... has it, in metres and Y up.
pub fn came_in(out: &Path) {
    let set = ScanSet::open(out).expect("a set");
    let scan = set.scan(&"anna/hips".parse().expect("a name")).expect("a clip");
    assert!(scan.vertices.len() >= 2);
    for (t, found) in scan.vertices.iter().enumerate() {
        for (v, (found, expected)) in found.iter().zip(frame(t)).enumerate() {
            assert!(found.distance(expected.into()) < 1e-5, "frame {t}, vertex {v}: {found}, expected {expected:?}");
        }
    }
}
