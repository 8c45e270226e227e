use crate::{ClipError, ClipId, DeltaClip, MotionClip, Result, ScanClip};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_geometry::Frames;
use softtissue_store::{StoreError, TensorFile, TensorFileWriter, read_json, write_json_atomic};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A clip in a set's list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClipEntry {
    /// Who, what, which take.
    pub id: ClipId,
    /// Frames.
    pub frames: usize,
    /// Frames a second.
    pub fps: f32,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Index {
    schema: u32,
    kind: String,
    vertex_count: usize,
    topology: String,
    provenance: serde_json::Value,
    clips: Vec<ClipEntry>,
}

fn read_index(root: &Path, kind: &str) -> Result<Index> {
    let path = root.join("index.json");
    let index: Index = read_json(&path)?;
    let bad = |reason: String| ClipError::Bad { path: path.clone(), reason };
    if index.schema != 1 || index.kind != kind {
        return Err(bad(format!(
            "it is a {} set of schema {}, expected a {kind} set of schema 1",
            index.kind, index.schema
        )));
    }
    if let Some(entry) = index.clips.iter().find(|c| !c.id.is_valid()) {
        return Err(bad(format!("its clip name {} holds characters that no file name may; rename it", entry.id)));
    }
    if let Some(id) = twice(&index.clips) {
        return Err(bad(format!("it lists {id} twice; make the set again")));
    }
    Ok(index)
}

fn twice(clips: &[ClipEntry]) -> Option<&ClipId> {
    let mut seen = BTreeSet::new();
    clips.iter().map(|c| &c.id).find(|id| !seen.insert(*id))
}

/// Takes the list of a set away before its clips are replaced: a half-replaced set must not look finished.
fn remove_index(root: &Path) -> Result<()> {
    let path = root.join("index.json");
    match std::fs::remove_file(&path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(StoreError::io("replace", &path, e).into()),
        _ => Ok(()),
    }
}

/// Lists the clips of a set, sorted; the list is written last.
fn finish(root: &Path, mut index: Index) -> Result<Index> {
    if let Some(id) = twice(&index.clips) {
        let reason = format!("two clips are named {id}; rename one");
        return Err(ClipError::Bad { path: root.to_owned(), reason });
    }
    index.clips.sort_by(|a, b| a.id.cmp(&b.id));
    write_json_atomic(&root.join("index.json"), &index)?;
    Ok(index)
}

impl Index {
    fn entry(&self, id: &ClipId, root: &Path) -> Result<&ClipEntry> {
        let found = self.clips.iter().find(|c| c.id == *id);
        found.ok_or_else(|| ClipError::NoClip { id: id.clone(), path: root.to_owned() })
    }
    /// Refuses a clip that is not the one the list speaks of; `points` where it has the set's vertices.
    fn check(&self, root: &Path, path: PathBuf, found: ClipEntry, points: Option<usize>) -> Result<()> {
        let listed = self.entry(&found.id, root)?;
        let bad = |reason: String| Err(ClipError::Bad { path, reason });
        if *listed != found {
            return bad(format!(
                "{} has {} frames at {} a second, but the set lists {} at {}; make the set again",
                found.id, found.frames, found.fps, listed.frames, listed.fps
            ));
        }
        match points {
            Some(n) if n != self.vertex_count => {
                bad(format!("{n} vertices, but the set has {}; make the set again", self.vertex_count))
            }
            _ => Ok(()),
        }
    }
}

/// A clip of another name than was asked for is not the one that the list speaks of.
fn check_name(path: &Path, wanted: &ClipId, found: &ClipId) -> Result<()> {
    if wanted == found {
        return Ok(());
    }
    let reason = format!("it holds the clip {found}, expected {wanted}; make the set again");
    Err(ClipError::Bad { path: path.to_owned(), reason })
}

/// Scans: a folder with `index.json` (written last), `scans/*.safetensors` and, where a rough pose channel
/// exists, `rough/*.safetensors`.
#[derive(Clone, Debug)]
pub struct ScanSet {
    root: PathBuf,
    index: Index,
}

impl ScanSet {
    /// Opens a finished set.
    pub fn open(root: &Path) -> Result<Self> {
        Ok(Self { root: root.to_owned(), index: read_index(root, "scan")? })
    }
    /// Closes a set whose clips are written: lists them.
    pub fn finish(
        root: &Path,
        vertex_count: usize,
        topology: &str,
        provenance: serde_json::Value,
        clips: Vec<ClipEntry>,
    ) -> Result<Self> {
        let index =
            Index { schema: 1, kind: "scan".into(), vertex_count, topology: topology.into(), provenance, clips };
        Ok(Self { root: root.to_owned(), index: finish(root, index)? })
    }
    /// Before clips are written into a folder that may hold a finished set: from now on it is unfinished.
    pub fn begin(root: &Path) -> Result<()> {
        remove_index(root)
    }
    /// Where a scan clip lies.
    pub fn scan_path(root: &Path, id: &ClipId) -> PathBuf {
        root.join("scans").join(id.stem() + ".safetensors")
    }
    /// Where the rough pose channel of a clip lies.
    pub fn rough_path(root: &Path, id: &ClipId) -> PathBuf {
        root.join("rough").join(id.stem() + ".safetensors")
    }
    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }
    /// Clips, sorted.
    pub fn clips(&self) -> &[ClipEntry] {
        &self.index.clips
    }
    /// Clip names, sorted.
    pub fn ids(&self) -> Vec<ClipId> {
        self.index.clips.iter().map(|c| c.id.clone()).collect()
    }
    /// Subjects, sorted, each once.
    pub fn subjects(&self) -> Vec<String> {
        let mut subjects: Vec<String> = self.index.clips.iter().map(|c| c.id.subject.clone()).collect();
        subjects.dedup();
        subjects
    }
    /// Vertices of every frame.
    pub fn vertex_count(&self) -> usize {
        self.index.vertex_count
    }
    /// Hash of the template topology.
    pub fn topology(&self) -> &str {
        &self.index.topology
    }
    /// Where the set came from.
    pub fn provenance(&self) -> &serde_json::Value {
        &self.index.provenance
    }
    /// Reads a clip and checks it against the list.
    pub fn scan(&self, id: &ClipId) -> Result<ScanClip> {
        self.index.entry(id, &self.root)?;
        let path = Self::scan_path(&self.root, id);
        let clip = ScanClip::read(&path)?;
        check_name(&path, id, &clip.id)?;
        let found = ClipEntry { id: id.clone(), frames: clip.vertices.len(), fps: clip.fps };
        self.index.check(&self.root, path, found, Some(clip.vertices.points_per_frame()))?;
        Ok(clip)
    }
    /// The rough pose channel of a clip, where the set has one.
    pub fn rough_motion(&self, id: &ClipId) -> Result<Option<MotionClip>> {
        self.index.entry(id, &self.root)?;
        let path = Self::rough_path(&self.root, id);
        if !path.exists() {
            return Ok(None);
        }
        let clip = MotionClip::read(&path)?;
        check_name(&path, id, &clip.id)?;
        let found = ClipEntry { id: id.clone(), frames: clip.len(), fps: clip.fps };
        self.index.check(&self.root, path, found, None)?;
        Ok(Some(clip))
    }
}

/// What a simulator knows of a subject.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrueSubject {
    /// Name.
    pub subject: String,
    /// Shape coefficients.
    pub beta: Vec<f32>,
    /// Body mass index, kg/m^2.
    pub bmi: f32,
    /// Everything else worth keeping (hidden material, style, ...).
    pub notes: serde_json::Value,
}

/// Truth: a folder beside the scans that only evaluation opens. `subjects.json`, `motions/`, `deltas/`
/// (true deltas) and `clean/` (posed vertices before the scanner).
#[derive(Clone, Debug)]
pub struct TruthSet {
    root: PathBuf,
    subjects: Vec<TrueSubject>,
}

impl TruthSet {
    /// Opens a finished truth folder.
    pub fn open(root: &Path) -> Result<Self> {
        Ok(Self { root: root.to_owned(), subjects: read_json(&root.join("subjects.json"))? })
    }
    /// Closes a truth folder whose clips are written.
    pub fn finish(root: &Path, subjects: Vec<TrueSubject>) -> Result<Self> {
        write_json_atomic(&root.join("subjects.json"), &subjects)?;
        Ok(Self { root: root.to_owned(), subjects })
    }
    /// Where the exact motion of a clip lies.
    pub fn motion_path(root: &Path, id: &ClipId) -> PathBuf {
        root.join("motions").join(id.stem() + ".safetensors")
    }
    /// Where the true deltas of a clip lie.
    pub fn delta_path(root: &Path, id: &ClipId) -> PathBuf {
        root.join("deltas").join(id.stem() + ".safetensors")
    }
    /// Where the clean posed vertices of a clip lie.
    pub fn clean_path(root: &Path, id: &ClipId) -> PathBuf {
        root.join("clean").join(id.stem() + ".safetensors")
    }
    /// True subjects.
    pub fn subjects(&self) -> &[TrueSubject] {
        &self.subjects
    }
    /// One true subject.
    pub fn subject(&self, name: &str) -> Option<&TrueSubject> {
        self.subjects.iter().find(|s| s.subject == name)
    }
    /// Exact motion of a clip.
    pub fn motion(&self, id: &ClipId) -> Result<MotionClip> {
        MotionClip::read(&Self::motion_path(&self.root, id))
    }
    /// True deltas of a clip.
    pub fn deltas(&self, id: &ClipId) -> Result<DeltaClip> {
        DeltaClip::read(&Self::delta_path(&self.root, id))
    }
    /// Clean posed vertices of a clip.
    pub fn clean(&self, id: &ClipId) -> Result<ScanClip> {
        ScanClip::read(&Self::clean_path(&self.root, id))
    }
}

/// What the fit found for a subject.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedSubject {
    /// Name.
    pub subject: String,
    /// Shape coefficients.
    pub beta: Vec<f32>,
    /// Static detail beyond the shape space, `[V]`, metres, rest frame; zero with `subject_template = false`.
    pub template: Vec<Vec3>,
    /// Weight of each vertex in the fit, high on rigid parts, `[V]`.
    pub fit_weight: Vec<f32>,
    /// Casas-Otaduy eq. 7: mean squared change of delta velocity, high on **flesh** in spite of its name, `[V]`.
    pub rigidity_weight: Vec<f32>,
}

/// Fitted subjects, fitted motions and scan deltas: `index.json`, `subjects/`, `motions/`, `deltas/`.
#[derive(Clone, Debug)]
pub struct FitSet {
    root: PathBuf,
    index: Index,
}

impl FitSet {
    /// Opens a finished set.
    pub fn open(root: &Path) -> Result<Self> {
        Ok(Self { root: root.to_owned(), index: read_index(root, "fit")? })
    }
    /// Closes a set whose clips and subjects are written.
    pub fn finish(
        root: &Path,
        vertex_count: usize,
        topology: &str,
        provenance: serde_json::Value,
        clips: Vec<ClipEntry>,
    ) -> Result<Self> {
        let index = Index { schema: 1, kind: "fit".into(), vertex_count, topology: topology.into(), provenance, clips };
        Ok(Self { root: root.to_owned(), index: finish(root, index)? })
    }
    /// Before clips are written into a folder that may hold a finished set: from now on it is unfinished.
    pub fn begin(root: &Path) -> Result<()> {
        remove_index(root)
    }
    /// Where the fitted motion of a clip lies.
    pub fn motion_path(root: &Path, id: &ClipId) -> PathBuf {
        root.join("motions").join(id.stem() + ".safetensors")
    }
    /// Where the scan deltas of a clip lie.
    pub fn delta_path(root: &Path, id: &ClipId) -> PathBuf {
        root.join("deltas").join(id.stem() + ".safetensors")
    }
    /// Where a subject lies.
    pub fn subject_path(root: &Path, subject: &str) -> PathBuf {
        root.join("subjects").join(format!("{subject}.safetensors"))
    }
    /// The folder.
    pub fn root(&self) -> &Path {
        &self.root
    }
    /// Clips, sorted.
    pub fn clips(&self) -> &[ClipEntry] {
        &self.index.clips
    }
    /// Vertices of every frame.
    pub fn vertex_count(&self) -> usize {
        self.index.vertex_count
    }
    /// Hash of the template topology.
    pub fn topology(&self) -> &str {
        &self.index.topology
    }
    /// Fitted motion of a clip, checked against the list.
    pub fn motion(&self, id: &ClipId) -> Result<MotionClip> {
        self.index.entry(id, &self.root)?;
        let path = Self::motion_path(&self.root, id);
        let clip = MotionClip::read(&path)?;
        check_name(&path, id, &clip.id)?;
        let found = ClipEntry { id: id.clone(), frames: clip.len(), fps: clip.fps };
        self.index.check(&self.root, path, found, None)?;
        Ok(clip)
    }
    /// Scan deltas of a clip, checked against the list.
    pub fn deltas(&self, id: &ClipId) -> Result<DeltaClip> {
        self.index.entry(id, &self.root)?;
        let path = Self::delta_path(&self.root, id);
        let clip = DeltaClip::read(&path)?;
        check_name(&path, id, &clip.id)?;
        let found = ClipEntry { id: id.clone(), frames: clip.deltas.len(), fps: clip.fps };
        self.index.check(&self.root, path, found, Some(clip.deltas.points_per_frame()))?;
        Ok(clip)
    }
    /// A fitted subject.
    pub fn subject(&self, name: &str) -> Result<FittedSubject> {
        FittedSubject::read(&Self::subject_path(&self.root, name))
    }
}

impl FittedSubject {
    /// Writes the subject.
    pub fn write(&self, path: &Path) -> Result<()> {
        let v = self.template.len();
        let template: Vec<f32> = self.template.iter().flat_map(|p| p.to_array()).collect();
        let mut file = TensorFileWriter::new();
        file.meta("softtissue", "1").meta("kind", "fitted-subject").meta("subject", &self.subject);
        file.f32("beta", &[self.beta.len()], &self.beta).f32("template", &[v, 3], &template);
        file.f32("fit_weight", &[v], &self.fit_weight).f32("rigidity_weight", &[v], &self.rigidity_weight);
        Ok(file.write(path)?)
    }
    /// Reads a subject.
    pub fn read(path: &Path) -> Result<Self> {
        let file = TensorFile::open(path)?;
        let template = Frames::from_numbers(1, &file.f32("template")?).points().to_vec();
        Ok(Self {
            subject: file.require_meta("subject")?.to_owned(),
            beta: file.f32("beta")?,
            template,
            fit_weight: file.f32("fit_weight")?,
            rigidity_weight: file.f32("rigidity_weight")?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clip(motion: &str, frames: usize) -> ScanClip {
        ScanClip { id: ClipId::new("s00", motion, 0), fps: 60.0, vertices: Frames::zeros(3, frames) }
    }

    fn set(root: &Path, listed: &[(&str, usize)]) -> Result<ScanSet> {
        let entry =
            |(m, frames): &(&str, usize)| ClipEntry { id: ClipId::new("s00", *m, 0), frames: *frames, fps: 60.0 };
        ScanSet::finish(root, 3, "t", serde_json::Value::Null, listed.iter().map(entry).collect())
    }

    #[test]
    fn clips_that_are_not_as_listed_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = ScanSet::scan_path(dir.path(), &ClipId::new("s00", "hips", 0));
        let set = set(dir.path(), &[("hips", 4)]).unwrap();
        let says = |clip: &ScanClip| {
            clip.write(&path).unwrap();
            set.scan(&ClipId::new("s00", "hips", 0)).map(|_| ()).map_err(|e| e.to_string())
        };
        assert_eq!(says(&clip("hips", 4)), Ok(()));
        assert!(says(&clip("hips", 5)).unwrap_err().contains("5 frames"));
        assert!(says(&clip("knees", 4)).unwrap_err().contains("s00/knees.0"));
        assert!(says(&ScanClip { fps: 30.0, ..clip("hips", 4) }).unwrap_err().contains("30"));
        let flat = ScanClip { vertices: Frames::zeros(2, 4), ..clip("hips", 4) };
        assert!(says(&flat).unwrap_err().contains("2 vertices"));
    }

    #[test]
    fn a_clip_is_listed_once() {
        let dir = tempfile::tempdir().unwrap();
        assert!(set(dir.path(), &[("hips", 4), ("hips", 4)]).unwrap_err().to_string().contains("s00/hips.0"));
        assert!(!dir.path().join("index.json").exists());
    }
}
