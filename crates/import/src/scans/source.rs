use super::files::{FrameFiles, FrameFormat, entries, read_frame};
use super::hdf5::Hdf5Scans;
use super::npz::NpzClip;
use super::{Conventions, FrameMesh, Units, UpAxis};
use crate::{ImportError, ImportLimits, Result};
use softtissue_clips::ClipId;
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How scans are brought in. What is `None` is read from the file where it says, and guessed where not.
#[derive(Clone, Copy, Debug)]
pub struct ScanImportConfig {
    /// Frames a second, whatever the file says.
    pub fps: Option<f32>,
    /// Frames a second where nobody says. Default 60, the rate of DFAUST and Dyna.
    pub assumed_fps: f32,
    /// Unit of the coordinates.
    pub units: Option<Units>,
    /// Which way is up.
    pub up: Option<UpAxis>,
    /// Whether frames whose number is missing are made by interpolation; otherwise they are an error.
    pub fill_gaps: bool,
    /// Limits.
    pub limits: ImportLimits,
}

impl Default for ScanImportConfig {
    fn default() -> Self {
        Self { fps: None, assumed_fps: 60.0, units: None, up: None, fill_gaps: false, limits: ImportLimits::default() }
    }
}

/// A file or folder of scans, its clips listed but no vertex read.
pub struct ScanSource {
    path: PathBuf,
    config: ScanImportConfig,
    clips: Vec<SourceClip>,
}

pub(crate) struct SourceClip {
    pub id: ClipId,
    pub content: Content,
}

pub(crate) enum Content {
    Files(FrameFiles),
    Hdf5(Arc<Hdf5Scans>, String),
    Npz(NpzClip),
}

impl ScanSource {
    /// Lists the clips of `SUBJECT/MOTION[.TAKE]/*.{obj,ply}`, of an HDF5 or npz file, or of a folder of such files.
    ///
    /// # Errors
    /// No scan found, a name that no clip can have, one that stands twice, or a file that cannot be read.
    pub fn open(path: &Path, config: &ScanImportConfig) -> Result<Self> {
        if let Some(fps) = config.fps
            && !(fps.is_finite() && fps > 0.0 && fps <= 1000.0)
        {
            let reason = format!("the rate {fps} is not between 0 and 1000 frames a second; pass --fps");
            return Err(ImportError::file(path, reason));
        }
        let mut clips = Vec::new();
        if path.is_dir() {
            list_folder(path, config, &mut clips)?;
        } else {
            list_file(path, config, &mut clips)?;
        }
        if clips.is_empty() {
            return Err(ImportError::file(
                path,
                "it holds no scan: expected SUBJECT/MOTION folders of *.obj or *.ply frames, or *.hdf5, *.h5 or *.npz files",
            ));
        }
        let mut seen = HashSet::new();
        if let Some(clip) = clips.iter().find(|c| !seen.insert(c.id.clone())) {
            return Err(clip.refuse(format!("it is a second clip named {}; give it another take", clip.id)));
        }
        Ok(Self { path: path.to_owned(), config: *config, clips })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }
    pub(crate) fn config(&self) -> &ScanImportConfig {
        &self.config
    }
    pub(crate) fn clips(&self) -> &[SourceClip] {
        &self.clips
    }

    /// What kind of scans, for people.
    pub fn format(&self) -> &'static str {
        match &self.clips[0].content {
            Content::Files(files) => match files.paths().next().and_then(FrameFormat::of) {
                Some(FrameFormat::Ply) => "PLY sequences",
                _ => "OBJ sequences",
            },
            Content::Hdf5(..) => "HDF5 of DFAUST's and Dyna's form",
            Content::Npz(_) => "npz of vertices",
        }
    }

    /// Whether the scans have no correspondence: the vertex count changes from frame to frame, or the frames are point
    /// clouds of another count than the template's `vertex_count`. Told from up to three frames of the first clip.
    pub fn is_raw(&self, vertex_count: usize) -> Result<bool> {
        let Content::Files(files) = &self.clips[0].content else { return Ok(false) };
        let paths: Vec<&Path> = files.paths().collect();
        let picked = [0, paths.len() / 2, paths.len() - 1];
        let frames: Vec<FrameMesh> =
            picked.iter().map(|i| read_frame(paths[*i], &self.config.limits)).collect::<Result<_>>()?;
        let varies = frames.iter().any(|f| f.positions.len() != frames[0].positions.len());
        // among registered frames one with another count is a mistake, which the import names
        let registered = frames.iter().filter(|f| f.positions.len() == vertex_count).count();
        Ok((varies || frames[0].faces.is_empty()) && registered == 0)
    }

    /// Units and up axis, from the first frame of the first clip where they are not stated.
    pub fn conventions(&self) -> Result<Conventions> {
        let (units, up) = (self.config.units, self.config.up);
        if let (Some(units), Some(up)) = (units, up) {
            return Ok(Conventions { units, up, guessed: vec![] });
        }
        Ok(Conventions::of(&self.clips[0].first_frame(&self.config.limits)?, units, up))
    }

    /// Frames a second, and whether that was assumed.
    pub fn fps(&self) -> Result<(f32, bool)> {
        if let Some(fps) = self.config.fps {
            return Ok((fps, false));
        }
        let stated = match &self.clips[0].content {
            Content::Npz(clip) => clip.fps()?,
            _ => None,
        };
        Ok(stated.map_or((self.config.assumed_fps, true), |fps| (fps, false)))
    }
}

impl SourceClip {
    /// A refusal that names this clip's file or folder.
    pub fn refuse(&self, reason: String) -> ImportError {
        match &self.content {
            Content::Files(files) => ImportError::file(&files.folder, reason),
            Content::Hdf5(file, name) => file.refuse(name, reason),
            Content::Npz(clip) => clip.place().refuse(reason),
        }
    }

    pub fn first_frame(&self, limits: &ImportLimits) -> Result<Vec<glam::Vec3>> {
        match &self.content {
            Content::Files(files) => match files.paths().next() {
                Some(path) => Ok(read_frame(path, limits)?.positions),
                None => Err(self.refuse("it holds no frame".into())),
            },
            Content::Hdf5(file, name) => Ok(file.clip(name, limits)?.read(0..1)?.frame(0).to_vec()),
            Content::Npz(clip) => Ok(clip.read(limits)?.frame(0).to_vec()),
        }
    }
}

fn extension(path: &Path) -> String {
    path.extension().map_or_else(String::new, |e| e.to_string_lossy().to_ascii_lowercase())
}

/// A clip's name from `SUBJECT_MOTION`, as DFAUST and Dyna write it.
fn id_of_name(name: &str) -> Option<ClipId> {
    let (subject, motion) = name.split_once('_')?;
    format!("{subject}/{motion}").parse().ok()
}

fn list_file(path: &Path, config: &ScanImportConfig, clips: &mut Vec<SourceClip>) -> Result<()> {
    match extension(path).as_str() {
        "hdf5" | "h5" => {
            let file = Arc::new(Hdf5Scans::open(path)?);
            for name in &file.names {
                let id = id_of_name(name).ok_or_else(|| {
                    file.refuse(name, "its name is not SUBJECT_SEQUENCE; rename it or take it out".into())
                })?;
                file.clip(name, &config.limits)?;
                clips.push(SourceClip { id, content: Content::Hdf5(file.clone(), name.clone()) });
            }
            Ok(())
        }
        "npz" => {
            let stem = path.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default();
            let id = id_of_name(&stem).ok_or_else(|| {
                ImportError::file(path, "its name is not SUBJECT_MOTION.npz, which names the clip; rename it")
            })?;
            clips.push(SourceClip { id, content: Content::Npz(NpzClip::open(path, &config.limits)?) });
            Ok(())
        }
        "obj" | "ply" => Err(ImportError::file(
            path,
            "it is a single frame, which has no velocity; name the folder that holds SUBJECT/MOTION/frames",
        )),
        _ if !path.exists() => Err(softtissue_store::StoreError::Missing { path: path.to_owned() }.into()),
        _ => Err(ImportError::file(
            path,
            "it is no scan that softtissue reads: *.hdf5, *.h5, *.npz, or a folder SUBJECT/MOTION of *.obj or *.ply",
        )),
    }
}

fn list_folder(path: &Path, config: &ScanImportConfig, clips: &mut Vec<SourceClip>) -> Result<()> {
    for (subject, below) in entries(path)? {
        if below.is_dir() {
            for (motion, folder) in entries(&below)?.into_iter().filter(|(_, p)| p.is_dir()) {
                let id = format!("{subject}/{motion}").parse().map_err(|_| {
                    ImportError::file(
                        &folder,
                        "its name and its subject's must be letters, digits, _ and -, with .TAKE at the end where there \
                         are several; rename it",
                    )
                })?;
                let files = FrameFiles::list(&folder, config.fill_gaps, &config.limits)?;
                clips.push(SourceClip { id, content: Content::Files(files) });
            }
        } else if matches!(extension(&below).as_str(), "hdf5" | "h5" | "npz") {
            list_file(&below, config, clips)?;
        }
    }
    Ok(())
}
