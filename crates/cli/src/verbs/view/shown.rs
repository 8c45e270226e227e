use crate::exit::InputError;
use anyhow::Result;
use softtissue_body::{BodyModel, RegionMap};
use softtissue_eval::viewer::{Surface, View, ViewClip, write};
use std::path::Path;

/// What a page will show.
pub struct Shown {
    /// Its title.
    pub title: String,
    /// What it is, in a line.
    pub about: String,
    /// What else is to be known, a sentence each.
    pub notes: Vec<String>,
    /// Triangles.
    pub faces: Vec<[u32; 3]>,
    /// Regions, where the mesh is a body's.
    pub regions: Option<RegionMap>,
    /// The layer that distances are measured from first.
    pub reference: Option<&'static str>,
    /// The clips.
    pub clips: Vec<ViewClip>,
}

impl Shown {
    /// Clips on a body's mesh.
    pub fn on(body: &BodyModel, path: &Path, about: String, clips: Vec<ViewClip>, notes: Vec<String>) -> Self {
        Self {
            title: title(path),
            about,
            notes,
            faces: body.topology.faces.clone(),
            regions: Some(body.regions.clone()),
            reference: None,
            clips,
        }
    }

    /// Writes the page.
    pub fn write(&self, out: &Path) -> Result<()> {
        self.notes.iter().for_each(|note| crate::print_line(note));
        Ok(write(&self.view(), out)?)
    }

    /// Writes a log for Rerun.
    #[cfg(feature = "rerun")]
    pub fn log(&self, out: &Path) -> Result<()> {
        Ok(softtissue_rerun::write(&self.view(), out)?)
    }

    fn view(&self) -> View<'_> {
        View {
            title: &self.title,
            about: &self.about,
            notes: &self.notes,
            surface: Surface { faces: &self.faces, regions: self.regions.as_ref() },
            reference: self.reference,
            clips: &self.clips,
        }
    }
}

/// A file or folder is called by its name.
pub fn title(path: &Path) -> String {
    let whole = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    whole.file_name().map_or_else(|| "softtissue".into(), |n| n.to_string_lossy().into_owned())
}

/// Clips of ours lack triangles: without their body there is nothing to show.
pub fn no_body(path: &Path, vertices: usize) -> InputError {
    InputError(format!(
        "{} holds points but no triangles, and no body of {vertices} vertices in their order was found near it: name it with \
         --body FILE",
        path.display()
    ))
}
