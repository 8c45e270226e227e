use crate::report::{by_rank, is_channel};
use crate::{BmiMetrics, ClipCurves, EvalError, Gate, PersonMetrics, Result, TimingMetrics};
use serde::{Deserialize, Serialize};
use softtissue_clips::ClipId;
use softtissue_store::{read_json, write_json_atomic};
use std::collections::BTreeMap;
use std::path::Path;

/// Version of the form of `metrics.json` that this program writes and reads.
pub const SCHEMA: u32 = 1;

/// Everything measured in one run: the content of `metrics.json`. What was not measured is absent, never zero.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metrics {
    /// [`SCHEMA`].
    pub schema: u32,
    /// `held-out`, `leave-one-sequence-out`, ...
    pub protocol: String,
    /// The run's seed.
    pub seed: u64,
    /// Whether the reference is the simulator's truth. If not, it is the scans' deltas.
    pub truth: bool,
    /// The method that the run is about; the others stand beside it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<String>,
    /// How much was judged.
    pub data: DataMetrics,
    /// By method, as in the design: `body`, `ridge`, `softtissue`, and variants after a slash.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub methods: BTreeMap<String, MethodMetrics>,
    /// By latent size.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub subspace: BTreeMap<u32, SubspaceMetrics>,
    /// The same person by person (SoftSMPL fig. 6; Casas-Otaduy 2018 fig. 5, where each has a subspace of their own).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub subspace_by_subject: BTreeMap<String, BTreeMap<u32, SubspaceMetrics>>,
    /// Person by person, on the main source of pose: the error by shape.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub people: BTreeMap<String, PersonMetrics>,
    /// Error frame by frame in a few clips (SoftSMPL figs. 5 and 7, Casas-Otaduy 2018 figs. 5 and 7).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub over_time: Vec<ClipCurves>,
    /// The fit that everything else stands on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<FitMetrics>,
    /// The same with each objective: `posed`, `unposed` (Casas-Otaduy fig. 3).
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub fit_objectives: BTreeMap<String, FitMetrics>,
    /// The truth's own speed 2 s after the motion's end over that before it, the worst probe.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest_truth: Option<f64>,
    /// Mean vertex speed of the deltas in mm/s against the shape coefficient that follows body mass
    /// (SoftSMPL fig. 8): pairs of `beta[1]` and speed, by method.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub shape_response: BTreeMap<String, Vec<[f64; 2]>>,
    /// How much and how fast the flesh moves on bodies of one height and another body mass index (Dyna sec. 6.3), by
    /// method.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub bmi_response: BTreeMap<String, Vec<BmiMetrics>>,
    /// Time of a frame, by method.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub timing: BTreeMap<String, TimingMetrics>,
    /// What a linear probe tells from a motion descriptor (SoftSMPL sec. 5), by descriptor.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub leak: BTreeMap<String, LeakMetrics>,
    /// Soft ratio on the clips that selected the model, by method: the method whole and without its recurrent unit.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub validation_soft_ratio: BTreeMap<String, f64>,
    /// Principal components that hold 95 % of the variance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub components_95: Option<ComponentMetrics>,
    /// Most memory that the process had held when the figures were complete, bytes. Absent where the system does not
    /// tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_memory_bytes: Option<u64>,
    /// Damped sinusoids fitted after an impact, one entry a probe and region.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub decays: Vec<DecayMetrics>,
    /// Acceptance values, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub gates: BTreeMap<String, Gate>,
    /// Clip by clip.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub clips: Vec<ClipMetrics>,
}

/// How much was judged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataMetrics {
    /// Vertices of the mesh.
    pub vertices: usize,
    /// Subjects of the judged clips, sorted.
    pub subjects: Vec<String>,
    /// Frames judged, all clips together.
    pub frames: usize,
}

/// One method over all judged clips.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MethodMetrics {
    /// By region name, `all`, `soft` and `rigid` among them.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub regions: BTreeMap<String, RegionMetrics>,
    /// Sum of errors over sum of body-alone errors, soft vertices.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub soft_ratio: Option<f64>,
    /// Frames rolled out in a second, one clip at a time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_per_second: Option<f64>,
    /// Long rollout: greatest regional rms over the greatest in training.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bounded_ratio: Option<f64>,
    /// Seconds of that rollout.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bounded_seconds: Option<f64>,
    /// Rms speed 2 s after the motion's end over that before it, the worst probe.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest_ratio: Option<f64>,
    /// Free decay: greatest error of frequency, hertz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decay_hz_error: Option<f64>,
    /// Free decay: greatest error of the damping ratio.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decay_damping_error: Option<f64>,
    /// Free decay: regions in which the truth rings and the method does not move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub decay_missing: Option<u32>,
    /// Clips on which the rollout left the finite numbers; then no regional figure is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub diverged_clips: Option<u32>,
}

/// One method in one region.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RegionMetrics {
    /// Mean distance to the reference deltas, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean_mm: Option<f64>,
    /// Its standard deviation over vertices and frames, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub std_mm: Option<f64>,
    /// Standard deviation over frames of each frame's mean distance, mm: how Casas and Otaduy (2018) give it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame_std_mm: Option<f64>,
    /// Mean distance to the scans' deltas, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan_mean_mm: Option<f64>,
    /// Its standard deviation, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan_std_mm: Option<f64>,
    /// Rms speed over the reference's, in regions that move.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub energy_ratio: Option<f64>,
    /// Mean error of the spectrum's highest peak, hertz.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_hz_error: Option<f64>,
    /// Mean rms difference of log power spectra, decibels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spectral_distance: Option<f64>,
    /// Mean lag at the best cross-correlation, milliseconds; positive: late.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag_ms: Option<f64>,
}

/// PCA against the autoencoder at one latent size, mean error over all vertices in mm. `pca_mm`, `ae_mm`: scan
/// deltas in, against true deltas; `scan_*`: against their input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SubspaceMetrics {
    /// PCA against truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pca_mm: Option<f64>,
    /// Autoencoder against truth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ae_mm: Option<f64>,
    /// PCA against its input.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan_pca_mm: Option<f64>,
    /// Autoencoder against its input.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan_ae_mm: Option<f64>,
    /// Whether validation kept the autoencoder's residual branches; if not, it is PCA.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub residual_kept: Option<bool>,
}

/// What a linear probe tells from a motion descriptor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeakMetrics {
    /// The subject, on motions that the probe has not seen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub subject: Option<ProbeMetrics>,
    /// The motion, on takes that the probe has not seen or on the other half of each clip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motion: Option<ProbeMetrics>,
}

/// How often a probe is right.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProbeMetrics {
    /// Mean over classes of the part of their frames that is told right.
    pub accuracy: f64,
    /// The same of guessing: one over the number of classes.
    pub chance: f64,
}

impl ProbeMetrics {
    /// Accuracy over chance, as a part of what there is over chance: 0 for guessing, 1 for knowing.
    pub fn excess(&self) -> f64 {
        (self.accuracy - self.chance) / (1.0 - self.chance)
    }
}

/// The fit against truth.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FitMetrics {
    /// Median angle between fitted and true joint rotations (relative to the parent), degrees.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_deg_median: Option<f64>,
    /// Its 95th percentile.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_deg_p95: Option<f64>,
    /// Median distance of posed joints, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_mm_median: Option<f64>,
    /// Its 95th percentile.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_mm_p95: Option<f64>,
    /// Mean distance of scan deltas from true deltas on soft vertices, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_mm_mean: Option<f64>,
    /// Its 95th percentile.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delta_mm_p95: Option<f64>,
    /// What the scanner added: mean distance of scan from clean posed vertices on soft vertices, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan_noise_mm: Option<f64>,
    /// Frames fitted in a second.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames_per_second: Option<f64>,
}

/// How many principal components hold 95 % of the variance of the training clips' deltas, mirrored as the subspace
/// learns them. Where all that were computed hold less, their number, which is then too low.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComponentMetrics {
    /// Of the scans' deltas.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scan: Option<u32>,
    /// Of the true deltas.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<u32>,
}

/// A damped sinusoid in numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DecayFigures {
    /// Damped frequency, hertz.
    pub hz: f64,
    /// Damping ratio.
    pub damping_ratio: f64,
    /// Share of the variance that it explains.
    pub explained: f64,
}

/// Free decay of one region in one probe.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DecayMetrics {
    /// Who.
    pub subject: String,
    /// Region name.
    pub region: String,
    /// The truth's decay.
    pub truth: DecayFigures,
    /// Each method's.
    pub methods: BTreeMap<String, DecayFigures>,
}

/// One clip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClipMetrics {
    /// Who.
    pub subject: String,
    /// What.
    pub motion: String,
    /// Which take.
    pub take: u32,
    /// Which fold of the protocol judged it, where there is more than one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fold: Option<String>,
    /// Each method on it.
    pub methods: BTreeMap<String, MethodMetrics>,
}

impl ClipMetrics {
    /// The clip's name.
    pub fn id(&self) -> ClipId {
        ClipId::new(&self.subject, &self.motion, self.take)
    }
}

impl Metrics {
    /// Methods on the main source of pose, from the plainest up.
    pub fn main_methods(&self) -> Vec<(&str, &MethodMetrics)> {
        let mut all: Vec<(&str, &MethodMetrics)> = self.methods.iter().map(|(n, m)| (n.as_str(), m)).collect();
        all.retain(|(name, _)| !is_channel(name));
        all.sort_by(|a, b| by_rank(a.0, b.0));
        all
    }

    /// Writes `metrics.json`, atomically. A number that JSON cannot hold is refused.
    pub fn write(&self, path: &Path) -> Result<()> {
        let value = serde_json::to_value(self)
            .map_err(|e| EvalError::Refused(format!("{}: the metrics cannot be written: {e}", path.display())))?;
        if let Some(place) = null_in(&value) {
            return Err(EvalError::Refused(format!(
                "{}: {place} is no finite number, so it is not written; the method that gave it has diverged",
                path.display()
            )));
        }
        Ok(write_json_atomic(path, &value)?)
    }

    /// Reads `metrics.json` of this schema.
    pub fn read(path: &Path) -> Result<Self> {
        let value: serde_json::Value = read_json(path)?;
        let schema = value.get("schema").and_then(serde_json::Value::as_u64);
        if schema != Some(u64::from(SCHEMA)) {
            let found = schema.map_or("no schema".into(), |s| format!("schema {s}"));
            return Err(EvalError::Refused(format!(
                "{}: it has {found}, this program reads schema {SCHEMA}; make it again with `softtissue eval`",
                path.display()
            )));
        }
        serde_json::from_value(value)
            .map_err(|e| EvalError::Refused(format!("{}: {e}; make it again with `softtissue eval`", path.display())))
    }

    /// The same without what depends on the clock and on the process: equal runs give equal values.
    pub fn without_times(&self) -> Self {
        let mut copy = self.clone();
        copy.peak_memory_bytes = None;
        copy.timing.clear();
        copy.methods.values_mut().for_each(|m| m.frames_per_second = None);
        copy.fit.iter_mut().chain(copy.fit_objectives.values_mut()).for_each(|f| f.frames_per_second = None);
        copy.gates.retain(|name, _| !name.starts_with("run."));
        copy
    }
}

/// Where a value holds null: serde_json's form of NaN and infinity.
fn null_in(value: &serde_json::Value) -> Option<String> {
    use serde_json::Value;
    let inside =
        |key: String, v: &Value| null_in(v).map(|rest| format!("{key}.{rest}").trim_end_matches('.').to_owned());
    match value {
        Value::Null => Some(String::new()),
        Value::Array(items) => items.iter().enumerate().find_map(|(i, v)| inside(i.to_string(), v)),
        Value::Object(map) => map.iter().find_map(|(k, v)| inside(k.clone(), v)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample() -> Metrics {
        let region = RegionMetrics { mean_mm: Some(0.8), std_mm: Some(0.5), ..Default::default() };
        let method = MethodMetrics {
            regions: [("soft".to_owned(), region)].into(),
            soft_ratio: Some(0.4),
            frames_per_second: Some(900.0),
            ..Default::default()
        };
        Metrics {
            schema: SCHEMA,
            protocol: "held-out".into(),
            seed: 7,
            truth: true,
            data: DataMetrics { vertices: 1724, subjects: vec!["s01".into()], frames: 150 },
            methods: [("softtissue".to_owned(), method)].into(),
            subspace: [(25, SubspaceMetrics { pca_mm: Some(1.0), ..Default::default() }), (100, Default::default())]
                .into(),
            gates: [("regressor.soft_ratio".to_owned(), Gate::new("soft ratio", "", Some(0.4), None, Some(0.6)))]
                .into(),
            ..Default::default()
        }
    }

    #[test]
    fn a_file_comes_back_as_it_was_and_holds_only_what_was_measured() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.json");
        sample().write(&path).unwrap();
        assert_eq!(Metrics::read(&path).unwrap(), sample());
        let json: serde_json::Value = read_json(&path).unwrap();
        assert_eq!(json["schema"], 1);
        assert_eq!(json["methods"]["softtissue"]["regions"]["soft"]["mean_mm"], 0.8);
        assert_eq!(json["subspace"]["25"]["pca_mm"], 1.0);
        let soft = json["methods"]["softtissue"]["regions"]["soft"].as_object().unwrap();
        assert_eq!(soft.keys().collect::<Vec<_>>(), ["mean_mm", "std_mm"]);
        assert!(json.get("fit").is_none() && json.get("clips").is_none());
    }

    #[test]
    fn another_schema_and_unknown_keys_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.json");
        for (change, word) in [(("schema", 2), "schema 2"), (("colour", 1), "colour")] {
            let mut value = serde_json::to_value(sample()).unwrap();
            value[change.0] = change.1.into();
            write_json_atomic(&path, &value).unwrap();
            let message = Metrics::read(&path).unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("metrics.json"), "{message}");
        }
    }

    #[test]
    fn a_number_that_is_none_is_refused_by_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("metrics.json");
        let mut metrics = sample();
        metrics.methods.get_mut("softtissue").unwrap().soft_ratio = Some(f64::NAN);
        let message = metrics.write(&path).unwrap_err().to_string();
        assert!(message.contains("methods.softtissue.soft_ratio"), "{message}");
        assert!(!path.exists());
    }

    #[test]
    fn times_can_be_left_out_of_a_comparison() {
        let mut other = sample();
        other.methods.get_mut("softtissue").unwrap().frames_per_second = Some(1.0);
        other.peak_memory_bytes = Some(1 << 30);
        other.timing.insert("softtissue".into(), TimingMetrics::default());
        other.gates.insert("run.peak_memory".into(), Gate::new("", "GiB", Some(1.0), None, Some(2.0)));
        assert_ne!(other, sample());
        assert_eq!(other.without_times(), sample().without_times());
    }
}
