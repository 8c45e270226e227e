//! What avatars are learned and judged on.

use crate::config::Config;
use crate::exit::{InputError, UsageError};
use crate::pipeline::context::Context;
use crate::pipeline::job::Prepared;
use crate::pipeline::judge::heaviest;
use crate::pipeline::kept::Kept;
use crate::pipeline::scans::Scans;
use anyhow::Result;
use softtissue_avatar::{AvatarBody, AvatarClip, ClipRequest, PoseSource};
use softtissue_body::BodyModel;
use softtissue_clips::{ClipId, FitSet, MotionClip, RawScans, Split};
use softtissue_geometry::Frames;
use softtissue_import::scans::{RawScanSource, ScanImportConfig, ScanSource, Units, UpAxis};
use softtissue_monitor::Monitor;
use std::path::Path;

/// Which frames of a clip a prediction may be compared with.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// All.
    Whole,
    /// What training sees of an interpolation motion.
    FirstHalf,
    /// What it is judged by.
    SecondHalf,
}

/// Body, fit, scans and raw scans of a run.
#[derive(Clone, Copy)]
pub struct AvatarScene<'a> {
    /// The run's settings.
    pub config: &'a Config,
    /// The body.
    pub body: &'a BodyModel,
    /// Shapes and motions.
    pub fit: &'a FitSet,
    /// The registered scans, for their rough poses, and truth.
    pub scans: &'a Scans,
    /// Who is left out.
    pub split: &'a Split,
    /// The raw scans.
    pub raw: &'a dyn RawScans,
    /// Progress and stopping.
    pub monitor: &'a dyn Monitor,
}

/// The raw scans that a set was made with, or that it was registered from.
pub fn open_raw(config: &Config, scans: &Scans, data: Option<&Path>) -> Result<RawScanSource> {
    let beside = scans.set.root().parent().map(|p| p.join("raw")).filter(|p| p.is_dir());
    let found = ScanImportConfig { assumed_fps: config.descriptor.fps, ..ScanImportConfig::default() };
    let (path, import) = match (beside, data) {
        (Some(path), _) => (path, ScanImportConfig { units: Some(Units::Metres), up: Some(UpAxis::Y), ..found }),
        (None, Some(data)) if !data.join("index.json").exists() => (data.to_owned(), found),
        _ => {
            let place = scans.set.root().display();
            let message = format!(
                "{place} holds registered scans alone, and autoavatar learns from raw ones: pass the raw scans by --data, or \
                 make some with synth.scanner.raw_points"
            );
            return Err(InputError(message).into());
        }
    };
    Ok(RawScanSource::new(&ScanSource::open(&path, &import)?)?)
}

impl<'a> AvatarScene<'a> {
    /// Of a run in progress.
    pub fn of(context: &'a Context, job: &'a Prepared, raw: &'a dyn RawScans) -> Self {
        let Prepared { body, fit, scans, split, .. } = job;
        Self { config: context.config, body, fit, scans, split, raw, monitor: context.monitor }
    }

    /// Of a finished run.
    pub fn kept(config: &'a Config, kept: &'a Kept, raw: &'a dyn RawScans, monitor: &'a dyn Monitor) -> Self {
        let Kept { body, scans, split, fit } = kept;
        Self { config, body, fit, scans, split, raw, monitor }
    }

    /// Whom to learn.
    pub fn subject(&self) -> Result<String> {
        let (config, train) = (&self.config.autoavatar, &self.split.train);
        if config.subject.is_empty() {
            return Ok(heaviest(self.fit, train)?.map(|id| id.subject).unwrap_or_default());
        }
        match train.iter().any(|id| id.subject == config.subject) {
            true => Ok(config.subject.clone()),
            false => {
                let message =
                    format!("autoavatar.subject is {}, of whom no clip trains; choose another", config.subject);
                Err(UsageError(message).into())
            }
        }
    }

    /// Clips of a person, each in a part.
    pub fn own(&self, subject: &str, ids: &[ClipId], part: Part) -> Vec<(ClipId, Part)> {
        ids.iter().filter(|id| id.subject == subject).map(|id| (id.clone(), part)).collect()
    }

    /// The second halves of the clips that training has seen the first half of.
    ///
    /// # Errors
    /// A motion is named that the subject has no training clip of.
    pub fn interpolation(&self, subject: &str) -> Result<Vec<(ClipId, Part)>> {
        let mut clips = self.own(subject, &self.split.train, Part::SecondHalf);
        let named = &self.config.autoavatar.interpolation;
        if let Some(motion) = named.iter().find(|m| clips.iter().all(|(id, _)| id.motion != **m)) {
            let message =
                format!("autoavatar.interpolation names {motion:?}, of which {subject} has no clip that trains");
            return Err(UsageError(format!("{message}; choose another, or write []")).into());
        }
        clips.retain(|(id, _)| named.contains(&id.motion));
        Ok(clips)
    }

    /// What a person is judged on: the interpolation set and the extrapolation set.
    ///
    /// # Errors
    /// Both are empty, or a motion is named that the subject has no training clip of.
    pub fn judged(&self, subject: &str) -> Result<[Vec<(ClipId, Part)>; 2]> {
        let sets = [self.interpolation(subject)?, self.own(subject, &self.split.test, Part::Whole)];
        if sets.iter().any(|set| !set.is_empty()) {
            return Ok(sets);
        }
        let message = format!(
            "no clip of {subject} is left out to judge by: name motions of this person in split.test_motions or \
             autoavatar.interpolation, choose another autoavatar.subject, or pass --no-eval"
        );
        Err(UsageError(message).into())
    }

    /// The poses that drive a clip.
    pub fn motion(&self, poses: PoseSource, id: &ClipId) -> Result<MotionClip> {
        match poses {
            PoseSource::Fitted => Ok(self.fit.motion(id)?),
            PoseSource::Rough => {
                let message =
                    || InputError(format!("{id} has no rough poses; set autoavatar.poses = \"fitted\"")).into();
                self.scans.set.rough_motion(id)?.ok_or_else(message)
            }
        }
    }

    /// The posed body of a clip, `[T, V]`, metres.
    pub fn posed(&self, poses: PoseSource, id: &ClipId) -> Result<Frames> {
        let motion = self.motion(poses, id)?;
        let shaped = self.body.shaped(&self.fit.subject(&id.subject)?.beta);
        Ok(self.body.posed_frames(&shaped, &motion.rotations, &motion.translations, None))
    }

    /// Reads clips, each in part.
    pub fn clips(&self, avatar: &AvatarBody, poses: PoseSource, wanted: &[(ClipId, Part)]) -> Result<Vec<AvatarClip>> {
        let config = &self.config.autoavatar;
        let mut clips = Vec::with_capacity(wanted.len());
        self.monitor.begin("raw scans", wanted.len() as u64, "clips");
        for (id, part) in wanted {
            let motion = self.motion(poses, id)?;
            let (all, half) = (motion.len(), motion.len() / 2);
            let frames = match part {
                Part::Whole => 0..all,
                Part::FirstHalf => 0..half,
                Part::SecondHalf => half..all,
            };
            let request = ClipRequest {
                motion: &motion,
                frames,
                kept_points: config.kept_points,
                outlier: config.outlier,
                seed: self.config.seed,
            };
            let shaped = self.body.shaped(&self.fit.subject(&id.subject)?.beta);
            clips.push(AvatarClip::read(avatar, self.body, &shaped, self.raw, &request, self.monitor)?);
            self.monitor.advance(1, &id.to_string());
        }
        self.monitor.end();
        Ok(clips)
    }
}
