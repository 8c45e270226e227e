use super::files::read_frame;
use super::source::{Content, SourceClip};
use super::{Conventions, ScanSource};
use crate::Result;
use softtissue_clips::{ClipId, interpolate_missing};
use softtissue_geometry::Frames;

/// What a clip of a source is, as far as it can be told without a template.
pub struct ClipSurvey {
    /// Who, what, which take.
    pub id: ClipId,
    /// Frames, missing ones among them.
    pub frames: usize,
    /// Frames whose number is missing.
    pub missing: Vec<usize>,
    /// Vertices of the first frame.
    pub vertices: usize,
    /// Whether the first frame or the file has faces.
    pub has_faces: bool,
    /// All frames in metres, Y up, missing ones interpolated; `None` where the vertex count changes.
    pub points: Option<Frames>,
}

impl ScanSource {
    /// Reads the clips one after the other, with `conventions`. One that cannot be read is an error of its own.
    pub fn survey<'a>(
        &'a self,
        conventions: &'a Conventions,
    ) -> impl Iterator<Item = (ClipId, Result<ClipSurvey>)> + 'a {
        self.clips().iter().map(move |clip| (clip.id.clone(), self.survey_clip(clip, conventions)))
    }

    fn survey_clip(&self, clip: &SourceClip, conventions: &Conventions) -> Result<ClipSurvey> {
        let limits = &self.config().limits;
        let (mut points, missing, has_faces) = match &clip.content {
            Content::Hdf5(file, name) => {
                let opened = file.clip(name, limits)?;
                let mut frames = Frames::new(opened.vertices);
                let step = opened.frames_a_read();
                for start in (0..opened.frames).step_by(step) {
                    opened.read(start..(start + step).min(opened.frames))?.iter().for_each(|f| frames.push(f));
                }
                (frames, vec![], file.faces(limits)?.is_some())
            }
            Content::Npz(npz) => (npz.read(limits)?, vec![], npz.faces(limits)?.is_some()),
            Content::Files(files) => {
                let mut frames: Option<Frames> = None;
                let mut has_faces = false;
                for (t, path) in files.slots.iter().enumerate() {
                    let Some(path) = path else { continue };
                    let mesh = read_frame(path, limits)?;
                    has_faces |= !mesh.faces.is_empty();
                    let count = mesh.positions.len();
                    let frames = frames.get_or_insert_with(|| Frames::zeros(count, files.slots.len()));
                    if frames.points_per_frame() != count || frames.points().len() > limits.clip_points {
                        return Ok(ClipSurvey {
                            id: clip.id.clone(),
                            frames: files.slots.len(),
                            missing: files.missing(),
                            vertices: frames.points_per_frame(),
                            has_faces,
                            points: None,
                        });
                    }
                    frames.frame_mut(t).copy_from_slice(&mesh.positions);
                }
                (frames.unwrap_or_default(), files.missing(), has_faces)
            }
        };
        points.points_mut().iter_mut().for_each(|p| *p = conventions.point(*p));
        interpolate_missing(&mut points, &missing);
        Ok(ClipSurvey {
            id: clip.id.clone(),
            frames: points.len(),
            missing,
            vertices: points.points_per_frame(),
            has_faces,
            points: Some(points),
        })
    }
}
