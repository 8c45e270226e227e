use anyhow::Result;
use softtissue_body::BodyModel;
use softtissue_body::procedural::{ProceduralConfig, generate};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Folders above a file that are searched for bodies.
const ABOVE: usize = 4;
/// Bodies that are read at most.
const READ: usize = 8;

/// Finds the body that clips of ours were made with: they hold points or angles, but neither triangles nor bones.
pub struct BodyFinder {
    given: Option<Arc<BodyModel>>,
    files: Vec<PathBuf>,
}

impl BodyFinder {
    /// The body that was given, or else those that lie near a file: `body-*.safetensors` in the folders above, in their
    /// `cache`, and in `data/cache`.
    ///
    /// # Errors
    /// The body that was given cannot be read.
    pub fn new(path: &Path, given: Option<&Path>) -> Result<Self> {
        let given = given.map(BodyModel::read).transpose()?.map(Arc::new);
        let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let mut folders: Vec<PathBuf> = Vec::new();
        for folder in path.ancestors().take(ABOVE + 1) {
            folders.extend([folder.to_owned(), folder.join("cache")]);
        }
        folders.push(PathBuf::from("data/cache"));
        let mut files: Vec<PathBuf> = Vec::new();
        for folder in folders {
            let Ok(entries) = std::fs::read_dir(folder) else { continue };
            let is_body = |p: &PathBuf| {
                p.file_name()
                    .and_then(|n| n.to_str())
                    .is_some_and(|n| (n.starts_with("body-") || n.starts_with("body.")) && n.ends_with(".safetensors"))
            };
            let mut found: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(is_body).collect();
            found.sort();
            files.extend(found);
        }
        files.truncate(READ);
        Ok(Self { given, files })
    }

    /// The first that suits.
    fn find(&self, suits: impl Fn(&BodyModel) -> bool) -> Option<Arc<BodyModel>> {
        if let Some(body) = &self.given {
            return Some(body.clone()).filter(|b| suits(b));
        }
        self.files.iter().filter_map(|f| BodyModel::read(f).ok()).find(|b| suits(b)).map(Arc::new)
    }

    /// A body with so many vertices and, where it is known, this topology.
    pub fn of_vertices(&self, vertices: usize, topology: Option<&str>) -> Option<Arc<BodyModel>> {
        self.find(|b| b.vertex_count() == vertices && topology.is_none_or(|t| b.topology.hash() == t))
    }

    /// A body with so many joints; the procedural one where none lies near.
    pub fn of_joints(&self, joints: usize) -> Option<Arc<BodyModel>> {
        self.find(|b| b.joint_count() == joints).or_else(|| {
            let config = ProceduralConfig { level: 0, people: 40, ..ProceduralConfig::default() };
            let made = (joints == 24).then(|| generate(&config).ok())??;
            Some(Arc::new(made.model))
        })
    }
}
