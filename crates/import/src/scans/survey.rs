use super::files::{FrameFiles, read_frame};
use super::hdf5::{Hdf5Clip, Hdf5Scans};
use super::source::{Content, SourceClip};
use super::{Conventions, ScanSource};
use crate::{ImportLimits, Result};
use glam::Vec3;
use softtissue_clips::ClipId;
use softtissue_clips::inspection::{ClipExam, ClipFindings, ExamConfig, Place, Problem, ProblemKind};

/// What a clip of a source is, as far as it can be told without a template.
pub struct ClipSurvey {
    /// Who, what, which take.
    pub id: ClipId,
    /// Frames, missing ones among them.
    pub frames: usize,
    /// Vertices of the first frame that can be read.
    pub vertices: usize,
    /// Range, mesh, sampled frames and problems, in metres with Y up.
    pub findings: ClipFindings,
}

impl ScanSource {
    /// Reads the clips one after the other and frame by frame, with `conventions`. One that cannot be read is an error
    /// of its own; a frame that cannot is a problem of its clip.
    pub fn survey<'a>(
        &'a self,
        conventions: &'a Conventions,
        fps: f32,
        config: ExamConfig,
    ) -> impl Iterator<Item = (ClipId, Result<ClipSurvey>)> + 'a {
        self.clips().iter().map(move |clip| {
            let surveyor = Surveyor { clip, conventions, fps, config, limits: &self.config().limits };
            (clip.id.clone(), surveyor.survey())
        })
    }
}

struct Surveyor<'a> {
    clip: &'a SourceClip,
    conventions: &'a Conventions,
    fps: f32,
    config: ExamConfig,
    limits: &'a ImportLimits,
}

impl Surveyor<'_> {
    fn survey(&self) -> Result<ClipSurvey> {
        match &self.clip.content {
            Content::Hdf5(file, name) => self.hdf5(file, &file.clip(name, self.limits)?),
            Content::Npz(npz) => {
                let frames = npz.read(self.limits)?;
                let mut exam = self.exam(frames.len()).faces(npz.faces(self.limits)?.unwrap_or_default());
                frames.iter().enumerate().for_each(|(t, frame)| exam.frame(t, &self.ours(frame)));
                Ok(self.told(frames.len(), frames.points_per_frame(), exam.finish()))
            }
            Content::Files(files) => self.files(files),
        }
    }

    fn exam(&self, frames: usize) -> ClipExam {
        ClipExam::new(frames, self.fps, self.config)
    }

    fn ours(&self, points: &[Vec3]) -> Vec<Vec3> {
        points.iter().map(|p| self.conventions.point(*p)).collect()
    }

    fn told(&self, frames: usize, vertices: usize, findings: ClipFindings) -> ClipSurvey {
        ClipSurvey { id: self.clip.id.clone(), frames, vertices, findings }
    }

    fn hdf5(&self, file: &Hdf5Scans, clip: &Hdf5Clip) -> Result<ClipSurvey> {
        let mut exam = self.exam(clip.frames).faces(file.faces(self.limits)?.unwrap_or_default());
        let mut readable = 0;
        let mut refused = None;
        for start in (0..clip.frames).step_by(clip.frames_a_read()) {
            let block = start..(start + clip.frames_a_read()).min(clip.frames);
            if let Ok(frames) = clip.read(block.clone()) {
                readable += frames.len();
                frames.iter().zip(block).for_each(|(frame, t)| exam.frame(t, &self.ours(frame)));
                continue;
            }
            // one frame spoils the block
            for t in block {
                match clip.read(t..t + 1) {
                    Ok(frames) => {
                        readable += 1;
                        exam.frame(t, &self.ours(frames.frame(0)));
                    }
                    Err(error) => {
                        exam.unreadable(t, &error.to_string());
                        refused.get_or_insert(error);
                    }
                }
            }
        }
        match refused {
            Some(error) if readable == 0 => Err(error),
            _ => Ok(self.told(clip.frames, clip.vertices, exam.finish())),
        }
    }

    fn files(&self, files: &FrameFiles) -> Result<ClipSurvey> {
        let mut exam = self.exam(files.slots.len());
        let mut vertices = None;
        let mut refused = None;
        for (t, path) in files.slots.iter().enumerate() {
            let Some(path) = path else { continue };
            match read_frame(path, self.limits) {
                Ok(mesh) => {
                    vertices.get_or_insert(mesh.positions.len());
                    exam.meshed_frame(t, &self.ours(&mesh.positions), mesh.triangles());
                }
                Err(error) => {
                    exam.unreadable(t, &error.to_string());
                    refused.get_or_insert(error);
                }
            }
        }
        let vertices = match (vertices, refused) {
            (None, Some(error)) => return Err(error),
            (vertices, _) => vertices.unwrap_or_default(),
        };
        let mut findings = exam.finish();
        let missing = files.missing();
        if !missing.is_empty() {
            let says = format!("{} frames are missing, which --fill-gaps of the import interpolates", missing.len());
            let places = missing.into_iter().map(Place::frame);
            findings.problems.insert(0, Problem::at(ProblemKind::MissingFrames, says, places));
        }
        Ok(self.told(files.slots.len(), vertices, findings))
    }
}
