use crate::{ClipError, ClipId, Result};
use glam::Vec3;
use softtissue_geometry::Frames;
use softtissue_store::{TensorFile, TensorFileWriter};
use std::path::Path;

/// A registered scan: posed vertices in template topology. Holds nothing that only a simulator knows.
#[derive(Clone, Debug, PartialEq)]
pub struct ScanClip {
    /// Who, what, which take.
    pub id: ClipId,
    /// Frames a second.
    pub fps: f32,
    /// Posed vertices `[T, V, 3]`, metres.
    pub vertices: Frames,
}

/// A skeletal motion: axis-angle joint rotations relative to the parent and the root's translation.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionClip {
    /// Who, what, which take.
    pub id: ClipId,
    /// Frames a second.
    pub fps: f32,
    /// Joint rotations `[T, J, 3]`, radians; joint 0 is the root's orientation.
    pub rotations: Frames,
    /// Root translation `[T, 3]`, metres, added after posing (SMPL's `trans`).
    pub translations: Vec<Vec3>,
}

/// Soft-tissue displacement of the unposed mesh: scan minus model (SoftSMPL eq. 3).
#[derive(Clone, Debug, PartialEq)]
pub struct DeltaClip {
    /// Who, what, which take.
    pub id: ClipId,
    /// Frames a second.
    pub fps: f32,
    /// Displacements `[T, V, 3]`, metres, rest frame.
    pub deltas: Frames,
}

impl MotionClip {
    /// Frames `T`.
    pub fn len(&self) -> usize {
        self.translations.len()
    }
    /// Whether there is no frame.
    pub fn is_empty(&self) -> bool {
        self.translations.is_empty()
    }
    /// A part of the clip, `range` in frames.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Self {
        Self {
            id: self.id.clone(),
            fps: self.fps,
            rotations: self.rotations.slice(range.clone()),
            translations: self.translations[range].to_vec(),
        }
    }
    /// Writes the clip.
    pub fn write(&self, path: &Path) -> Result<()> {
        self.write_with_provenance(path, &serde_json::Value::Null)
    }
    /// Writes the clip with where it came from, which `null` leaves out.
    pub fn write_with_provenance(&self, path: &Path, provenance: &serde_json::Value) -> Result<()> {
        Ok(self.with_file(provenance, |file| file.write(path))?)
    }
    /// The bytes of its file.
    pub fn to_bytes(&self) -> Vec<u8> {
        self.with_file(&serde_json::Value::Null, |file| file.to_bytes())
    }
    fn with_file<T>(&self, provenance: &serde_json::Value, then: impl FnOnce(&TensorFileWriter) -> T) -> T {
        assert_eq!(self.rotations.len(), self.translations.len(), "frames of a motion");
        let rotations = self.rotations.to_numbers();
        let translations: Vec<f32> = self.translations.iter().flat_map(|p| p.to_array()).collect();
        let mut file = header("motion", &self.id, self.fps);
        if !provenance.is_null() {
            file.meta("provenance", provenance.to_string());
        }
        file.f32("rotations", &[self.len(), self.rotations.points_per_frame(), 3], &rotations);
        file.f32("translations", &[self.len(), 3], &translations);
        then(&file)
    }
    /// Reads and checks a clip: finite numbers, equal frame counts, a positive rate.
    pub fn read(path: &Path) -> Result<Self> {
        let (file, id, fps) = open("motion", path)?;
        let rotations = frames(&file, "rotations")?;
        let translations = file.f32("translations")?;
        if file.require_shape("translations", 2)? != [rotations.len(), 3] {
            return Err(bad(
                path,
                format!("{} frames of rotations but translations of another count; make it again", rotations.len()),
            ));
        }
        check_finite(path, "translations", &translations, 3)?;
        let translations = translations.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)).collect();
        Ok(Self { id, fps, rotations, translations })
    }
}

impl ScanClip {
    /// Writes the clip.
    pub fn write(&self, path: &Path) -> Result<()> {
        let numbers = self.vertices.to_numbers();
        let mut file = header("scan", &self.id, self.fps);
        file.f32("vertices", &[self.vertices.len(), self.vertices.points_per_frame(), 3], &numbers);
        Ok(file.write(path)?)
    }
    /// Reads and checks a clip.
    pub fn read(path: &Path) -> Result<Self> {
        let (file, id, fps) = open("scan", path)?;
        Ok(Self { vertices: frames(&file, "vertices")?, id, fps })
    }
}

impl DeltaClip {
    /// Writes the clip.
    pub fn write(&self, path: &Path) -> Result<()> {
        let numbers = self.deltas.to_numbers();
        let mut file = header("delta", &self.id, self.fps);
        file.f32("deltas", &[self.deltas.len(), self.deltas.points_per_frame(), 3], &numbers);
        Ok(file.write(path)?)
    }
    /// Reads and checks a clip.
    pub fn read(path: &Path) -> Result<Self> {
        let (file, id, fps) = open("delta", path)?;
        Ok(Self { deltas: frames(&file, "deltas")?, id, fps })
    }
}

fn header<'a>(kind: &str, id: &ClipId, fps: f32) -> TensorFileWriter<'a> {
    let mut file = TensorFileWriter::new();
    file.meta("softtissue", "1").meta("kind", kind).meta("subject", &id.subject).meta("motion", &id.motion);
    file.meta("take", id.take.to_string()).meta("fps", fps.to_string());
    file
}

pub(crate) fn open(kind: &str, path: &Path) -> Result<(TensorFile, ClipId, f32)> {
    let file = TensorFile::open(path)?;
    let found = file.require_meta("kind")?;
    if found != kind {
        return Err(bad(path, format!("it is a {found} clip, expected a {kind} clip")));
    }
    let take =
        file.require_meta("take")?.parse().map_err(|_| bad(path, "its take is no number; make it again".into()))?;
    let id = ClipId::new(file.require_meta("subject")?, file.require_meta("motion")?, take);
    if !id.is_valid() {
        return Err(bad(path, format!("its name {id} holds characters that no file name may; rename it")));
    }
    let fps: f32 = file.require_meta("fps")?.parse().unwrap_or(f32::NAN);
    if !(fps.is_finite() && fps > 0.0 && fps <= 1000.0) {
        return Err(bad(path, format!("its rate {fps} is not between 0 and 1000 frames a second; correct `fps`")));
    }
    Ok((file, id, fps))
}

fn frames(file: &TensorFile, name: &str) -> Result<Frames> {
    let shape = file.require_shape(name, 3)?;
    let (t, v) = (shape[0], shape[1]);
    if t == 0 || v == 0 || shape[2] != 3 {
        return Err(bad(
            file.path(),
            format!("{name} has shape {shape:?}, expected frames x points x 3 with at least one of each"),
        ));
    }
    let numbers = file.f32(name)?;
    check_finite(file.path(), name, &numbers, v * 3)?;
    Ok(Frames::from_numbers(v, &numbers))
}

fn check_finite(path: &Path, name: &str, numbers: &[f32], per_frame: usize) -> Result<()> {
    match numbers.iter().position(|x| !x.is_finite()) {
        Some(i) => Err(bad(
            path,
            format!(
                "{name} has {} in frame {}, point {}; mend the source",
                numbers[i],
                i / per_frame,
                i % per_frame / 3
            ),
        )),
        None => Ok(()),
    }
}

fn bad(path: &Path, reason: String) -> ClipError {
    ClipError::Bad { path: path.to_owned(), reason }
}
