use crate::{EvalError, Result};
use serde::{Deserialize, Serialize};
use softtissue_implicit::RolloutFigures;
use softtissue_store::{read_json, write_json_atomic};
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Version of the form.
const SURFACE_SCHEMA: u32 = 2;
/// The row of standing still: the last true heights, kept.
pub const STILL: &str = "standing-still";
/// What the form says of itself.
const KIND: &str = "surfaces";

/// A row of the table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceFigures {
    /// The paper's table 1, and the energy of the heights.
    pub rollout: RolloutFigures,
    /// Rms difference of the log power spectra of regional changes of height, decibels, of rollouts through whole clips;
    /// mean over regions that move and over clips.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectral_db: Option<f64>,
}

/// A long rollout over one training motion, played over and over.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CycleFigures {
    /// Which clip.
    pub clip: String,
    /// Frames of the rollout.
    pub frames: usize,
    /// The greatest regional rms of the heights about their true mean in any frame over the greatest true one of the
    /// clip, worst moving region.
    pub bounded_ratio: f64,
    /// Rms of the heights about their true mean in the rollout's last quarter over that in its first.
    pub growth: f64,
    /// Wall-clock milliseconds of a frame: a prediction and its heights.
    pub frame_ms: f64,
}

/// Errors frame by frame over one clip (the paper's fig. 7): rollouts that are started once.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceCurves {
    /// Which clip.
    pub clip: String,
    /// Frames a second.
    pub fps: f32,
    /// The first frame that is judged.
    pub start: usize,
    /// Mean distance of scan points from the prediction, mm, by row of the table; absent where there is no scan.
    pub distance_mm: BTreeMap<String, Vec<Option<f64>>>,
    /// Wall-clock milliseconds of a frame of a network: a prediction, its heights, its surface drawn on the grid and measured.
    pub frame_ms: BTreeMap<String, f64>,
}

/// How a run's surfaces were judged: `autoavatar.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceMetrics {
    kind: String,
    /// Version of the form.
    pub schema: u32,
    /// Whose surface.
    pub subject: String,
    /// Which poses drive the run's own rows: `fitted` or `rough`.
    pub poses: String,
    /// Cells along the longest side of the grid that surfaces are drawn from.
    pub grid: usize,
    /// Rows by name, for motions that training has seen the first half of.
    pub interpolation: BTreeMap<String, SurfaceFigures>,
    /// The same, for motions that training has not seen.
    pub extrapolation: BTreeMap<String, SurfaceFigures>,
    /// Long rollouts of rows that feed on their own heights.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub cycles: BTreeMap<String, CycleFigures>,
    /// Errors over time of one clip that training has not seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub over_time: Option<SurfaceCurves>,
}

impl SurfaceMetrics {
    /// Of a person, without a row.
    pub fn new(subject: &str, poses: &str, grid: usize) -> Self {
        Self {
            kind: KIND.into(),
            schema: SURFACE_SCHEMA,
            subject: subject.into(),
            poses: poses.into(),
            grid,
            interpolation: BTreeMap::new(),
            extrapolation: BTreeMap::new(),
            cycles: BTreeMap::new(),
            over_time: None,
        }
    }

    /// Both sets that have rows, by name.
    pub fn sets(&self) -> impl Iterator<Item = (&'static str, &BTreeMap<String, SurfaceFigures>)> {
        let sets = [("interpolation", &self.interpolation), ("extrapolation", &self.extrapolation)];
        sets.into_iter().filter(|(_, rows)| !rows.is_empty())
    }

    /// Names of all rows, from the plainest up.
    pub fn rows(&self) -> Vec<&str> {
        let names: BTreeSet<&str> = self.sets().flat_map(|(_, rows)| rows.keys().map(String::as_str)).collect();
        let mut names: Vec<&str> = names.into_iter().collect();
        names.sort_by(|a, b| by_rank(a, b));
        names
    }

    /// Whether a file says of itself that it holds such measures.
    pub fn is_at(path: &Path) -> bool {
        let value: Result<serde_json::Value, _> = read_json(path);
        value.is_ok_and(|v| v.get("kind").and_then(serde_json::Value::as_str) == Some(KIND))
    }

    /// Reads a file of this schema.
    ///
    /// # Errors
    /// The disk, another schema or a damaged file.
    pub fn read(path: &Path) -> Result<Self> {
        let again = "make it again with `softtissue eval`";
        let value: serde_json::Value = read_json(path)?;
        let schema = value.get("schema").and_then(serde_json::Value::as_u64);
        if schema != Some(u64::from(SURFACE_SCHEMA)) {
            let found = schema.map_or("no schema".into(), |s| format!("schema {s}"));
            let path = path.display();
            let message = format!("{path}: it has {found}, this program reads schema {SURFACE_SCHEMA}; {again}");
            return Err(EvalError::Refused(message));
        }
        serde_json::from_value(value).map_err(|e| EvalError::Refused(format!("{}: {e}; {again}", path.display())))
    }

    /// Writes it, atomically.
    ///
    /// # Errors
    /// The disk.
    pub fn write(&self, path: &Path) -> Result<()> {
        Ok(write_json_atomic(path, self)?)
    }
}

/// From what knows least up; a name before the slash is another run's folder.
fn by_rank(a: &str, b: &str) -> Ordering {
    const ORDER: [&str; 6] = [STILL, "body", "pose", "pose-tcn", "pose-differences", "autoregressive"];
    let rank = |name: &str| {
        let (folder, own) = name.rsplit_once('/').unwrap_or(("", name));
        let place = ORDER.iter().position(|o| *o == own).unwrap_or(ORDER.len());
        // methods of registered meshes after the run's own rows, other avatars at the end
        (if folder.is_empty() { 0 } else { 1 }, folder.to_owned(), place)
    };
    rank(a).cmp(&rank(b)).then_with(|| a.cmp(b))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_stand_from_the_plainest_up() {
        let mut metrics = SurfaceMetrics::new("s00", "fitted", 64);
        for name in ["closest/autoregressive", "softsmpl", "autoregressive", "pose", STILL, "body", "closest/pose"] {
            metrics.extrapolation.insert(name.into(), SurfaceFigures::default());
        }
        metrics.interpolation.insert("pose-tcn".into(), SurfaceFigures::default());
        let wanted = [STILL, "body", "pose", "pose-tcn", "autoregressive", "softsmpl", "closest/pose"];
        assert_eq!(metrics.rows()[..7], wanted);
    }

    #[test]
    fn a_file_is_known_and_another_schema_refused() {
        let home = tempfile::tempdir().unwrap();
        let path = home.path().join("autoavatar.json");
        let mut metrics = SurfaceMetrics::new("s00", "rough", 64);
        let rollout = RolloutFigures { distance_mm: [(1, 2.5)].into(), rollouts: 3, ..RolloutFigures::default() };
        metrics.extrapolation.insert("pose".into(), SurfaceFigures { rollout, spectral_db: Some(4.0) });
        metrics.write(&path).unwrap();
        assert!(SurfaceMetrics::is_at(&path));
        assert_eq!(SurfaceMetrics::read(&path).unwrap(), metrics);
        assert_eq!(metrics.sets().count(), 1);
        metrics.schema = 1;
        metrics.write(&path).unwrap();
        assert!(SurfaceMetrics::read(&path).unwrap_err().to_string().contains("schema 1"));
    }
}
