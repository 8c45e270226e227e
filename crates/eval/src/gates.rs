use crate::report::number;
use crate::{MethodMetrics, Metrics};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// An acceptance value: what is asked for, what was found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// In words.
    pub what: String,
    /// Unit, empty for ratios.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
    /// The figure; absent if it could not be measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// The least that is accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_least: Option<f64>,
    /// The most that is accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_most: Option<f64>,
    /// Whether the value lies within; absent if it was not measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub met: Option<bool>,
}

impl Gate {
    /// A gate with either limit or both.
    pub fn new(
        what: impl Into<String>,
        unit: &str,
        value: Option<f64>,
        at_least: Option<f64>,
        at_most: Option<f64>,
    ) -> Self {
        let met = value.map(|x| at_least.is_none_or(|low| x >= low) && at_most.is_none_or(|high| x <= high));
        Self { what: what.into(), unit: unit.into(), value, at_least, at_most, met }
    }

    /// The figure with its unit, `–` where it was not measured; with more digits where it would read like its limit.
    pub fn found(&self) -> String {
        let Some(value) = self.value else { return "–".into() };
        let limits = [self.at_least, self.at_most];
        let close = limits.into_iter().flatten().any(|limit| limit != value && number(limit) == number(value));
        let figure = if close { format!("{value:.4}") } else { number(value) };
        figure + &self.unit_after()
    }

    /// The limits in words.
    pub fn asked(&self) -> String {
        let unit = self.unit_after();
        match (self.at_least, self.at_most) {
            (Some(low), Some(high)) => format!("{} to {}{unit}", number(low), number(high)),
            (Some(low), None) => format!("at least {}{unit}", number(low)),
            (None, Some(high)) => format!("at most {}{unit}", number(high)),
            (None, None) => "–".into(),
        }
    }

    /// `met`, `missed` or `not measured`.
    pub fn verdict(&self) -> &'static str {
        match self.met {
            Some(true) => "met",
            Some(false) => "missed",
            None => "not measured",
        }
    }

    fn unit_after(&self) -> String {
        if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) }
    }
}

/// The name under which the project's own method is judged.
pub const OURS: &str = "softtissue";

/// The name of a method without its recurrent unit.
pub fn without_gru(method: &str) -> String {
    format!("{method}/without-gru")
}

/// The acceptance values of the run's method that follow from what has been measured, by name. What was not measured stands there without
/// a value.
pub fn acceptance(metrics: &Metrics) -> BTreeMap<String, Gate> {
    let mut gates = BTreeMap::new();
    regressor(metrics, &mut gates);
    subspace(metrics, &mut gates);
    fit(metrics, &mut gates);
    data(metrics, &mut gates);
    memory(metrics, &mut gates);
    gates
}

fn regressor(metrics: &Metrics, gates: &mut BTreeMap<String, Gate>) {
    let name = metrics.method.as_deref().unwrap_or(OURS);
    let ours = metrics.methods.get(name);
    let of = |part: fn(&MethodMetrics) -> Option<f64>| ours.and_then(part);
    let soft = |m: &MethodMetrics| m.regions.get("soft").copied().unwrap_or_default();
    let ratio = of(|m| m.soft_ratio);
    let mut put = |name: &str, gate: Gate| gates.insert(format!("regressor.{name}"), gate);
    put("soft_ratio", Gate::new("error on soft vertices over that of the body alone", "", ratio, None, Some(0.60)));
    // several feature sets of the same baseline stand under variants; the better one counts
    let ar2 = |part: &dyn Fn(&MethodMetrics) -> Option<f64>| {
        let variants = metrics.methods.iter().filter(|(n, _)| is_variant_of(n, "ar2-subject"));
        variants.filter_map(|(_, m)| part(m)).min_by(f64::total_cmp)
    };
    let against_ar2 = ratio.zip(ar2(&|m| m.soft_ratio)).map(|(a, b)| a / b);
    put(
        "against_ar2",
        Gate::new("soft ratio over that of the better per-subject AR(2)", "", against_ar2, None, Some(0.90)),
    );
    let own = metrics.rest_truth.map_or(String::new(), |r| format!(" (the flesh itself: {r:.3})"));
    let rest = format!("rms speed 2 s after the motion's end over that before it{own}");
    let energy = ours.and_then(|m| soft(m).energy_ratio);
    put(
        "energy",
        Gate::new("rms speed over the reference's, soft regions that move", "", energy, Some(0.8), Some(1.2)),
    );
    let spectral = ours.and_then(|m| soft(m).spectral_distance);
    let spectral = spectral.zip(ar2(&|m| soft(m).spectral_distance)).map(|(a, b)| a / b);
    put("spectrum", Gate::new("spectral distance over that of the per-subject AR(2)", "", spectral, None, Some(1.0)));
    put(
        "bounded",
        Gate::new(
            "greatest regional rms in a long rollout over the greatest in training",
            "",
            of(|m| m.bounded_ratio),
            None,
            Some(1.5),
        ),
    );
    put("rest", Gate::new(&rest, "", of(|m| m.rest_ratio.filter(|_| m.diverged_clips.is_none())), None, Some(0.05)));
    let on_validation = |name: &str| metrics.validation_soft_ratio.get(name).copied();
    let share =
        on_validation(name).zip(on_validation(&without_gru(name))).map(|(whole, without)| 1.0 - whole / without);
    let what = "what the recurrent unit takes off the error on soft vertices, validation clips";
    put("gru_share", Gate::new(what, "", share, Some(0.03), None));
    let mut decay = |name, what, unit, value: Option<f64>, most| {
        let mut gate = Gate::new(what, unit, value, None, Some(most));
        if ours.and_then(|m| m.decay_missing).is_some_and(|n| n > 0) {
            gate.what += " (some regions that ring do not move at all)";
            gate.met = Some(false);
        }
        put(name, gate);
    };
    decay("decay_hz", "free decay: greatest error of frequency", "Hz", of(|m| m.decay_hz_error), 0.3);
    decay("decay_damping", "free decay: greatest error of the damping ratio", "", of(|m| m.decay_damping_error), 0.05);
}

fn is_variant_of(name: &str, base: &str) -> bool {
    let rest = name.strip_prefix(base);
    rest.is_some_and(|r| r.is_empty() || (r.starts_with('/') && !["/fitted", "/rough"].iter().any(|c| r.ends_with(c))))
}

fn subspace(metrics: &Metrics, gates: &mut BTreeMap<String, Gate>) {
    for (latent, most) in [(25, 0.97), (50, 1.0), (100, 1.0)] {
        let row = metrics.subspace.get(&latent).copied().unwrap_or_default();
        let pair = row.ae_mm.zip(row.pca_mm).or(row.scan_ae_mm.zip(row.scan_pca_mm));
        let ratio = pair.map(|(ae, pca)| ae / pca);
        let mut gate = Gate::new(format!("autoencoder's error over PCA's at {latent}"), "", ratio, None, Some(most));
        if row.residual_kept == Some(false) {
            gate.what += " (validation kept PCA)";
            gate.met = Some(false);
        }
        gates.insert(format!("subspace.{latent}"), gate);
    }
}

fn fit(metrics: &Metrics, gates: &mut BTreeMap<String, Gate>) {
    let fit = metrics.fit.unwrap_or_default();
    let mut put = |name: &str, gate: Gate| gates.insert(format!("fit.{name}"), gate);
    put("joint_deg", Gate::new("median joint angle error", "degrees", fit.joint_deg_median, None, Some(1.0)));
    put("joint_mm", Gate::new("median joint position error", "mm", fit.joint_mm_median, None, Some(3.0)));
    let most = fit.scan_noise_mm.map(|n| n + 1.0);
    let value = fit.delta_mm_mean.filter(|_| most.is_some());
    put(
        "delta_mm",
        Gate::new("scan deltas against true ones; at most the scanner's own error and 1 mm", "mm", value, None, most),
    );
}

fn data(metrics: &Metrics, gates: &mut BTreeMap<String, Gate>) {
    let components = metrics.components_95.unwrap_or_default();
    for (name, whose, value, least) in
        [("scan", "scan deltas", components.scan, 40.0), ("true", "true deltas", components.truth, 20.0)]
    {
        let what = format!("components for 95 % of the variance of {whose}, training clips");
        gates.insert(format!("data.{name}_components"), Gate::new(what, "", value.map(f64::from), Some(least), None));
    }
}

/// Vertices up to which a run counts as small.
const SMALL: usize = 2000;
const GIB: f64 = (1u64 << 30) as f64;

fn memory(metrics: &Metrics, gates: &mut BTreeMap<String, Gate>) {
    let most = if metrics.data.vertices <= SMALL { 2.0 } else { 8.0 };
    let value = metrics.peak_memory_bytes.map(|b| b as f64 / GIB);
    let gate = Gate::new("most memory held until the figures were complete", "GiB", value, None, Some(most));
    gates.insert("run.peak_memory".into(), gate);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ComponentMetrics, RegionMetrics, SubspaceMetrics, Tally};

    fn metrics() -> Metrics {
        let mut metrics = Tally::default().metrics("held-out", 1);
        let method = |soft_ratio, energy_ratio, spectral_distance| MethodMetrics {
            soft_ratio: Some(soft_ratio),
            regions: [(
                "soft".to_owned(),
                RegionMetrics {
                    energy_ratio: Some(energy_ratio),
                    spectral_distance: Some(spectral_distance),
                    ..Default::default()
                },
            )]
            .into(),
            ..Default::default()
        };
        metrics.methods.insert(OURS.into(), method(0.45, 0.7, 3.0));
        metrics.methods.insert("ar2-subject".into(), method(0.60, 0.7, 4.0));
        metrics.methods.insert("ar2-subject/dyna".into(), method(0.48, 0.7, 5.0));
        metrics.methods.insert("ar2-subject/dyna/fitted".into(), method(0.10, 0.7, 1.0));
        metrics
    }

    #[test]
    fn a_narrow_miss_does_not_read_like_its_limit() {
        let found = |value| Gate::new("", "mm", Some(value), None, Some(1.0)).found();
        assert_eq!(found(1.0012), "1.0012 mm");
        assert_eq!(found(1.0), number(1.0) + " mm");
        assert_eq!(found(1.2), number(1.2) + " mm");
        assert_eq!(Gate::new("", "mm", None, None, Some(1.0)).found(), "–");
    }

    #[test]
    fn gates_are_met_within_their_limits_only() {
        let met = |value, low, high| Gate::new("", "", value, low, high).met;
        assert_eq!(met(Some(0.6), None, Some(0.6)), Some(true));
        assert_eq!(met(Some(0.61), None, Some(0.6)), Some(false));
        assert_eq!(met(Some(0.7), Some(0.8), Some(1.2)), Some(false));
        assert_eq!(met(Some(f64::NAN), None, Some(1.0)), Some(false));
        assert_eq!(met(None, None, Some(1.0)), None);
    }

    #[test]
    fn a_gate_in_words() {
        let gate = Gate::new("", "Hz", Some(0.41), None, Some(0.3));
        assert_eq!((gate.found().as_str(), gate.asked().as_str()), ("0.41 Hz", "at most 0.30 Hz"));
        assert_eq!(gate.verdict(), "missed");
        let open = Gate::new("", "", None, Some(0.8), Some(1.2));
        assert_eq!((open.found().as_str(), open.asked().as_str()), ("–", "0.80 to 1.20"));
    }

    #[test]
    fn the_better_baseline_counts_and_other_channels_do_not() {
        let gates = acceptance(&metrics());
        let met = |name: &str| (gates[name].value.map(|v| (v * 1e4).round() / 1e4), gates[name].met);
        assert_eq!(met("regressor.soft_ratio"), (Some(0.45), Some(true)));
        assert_eq!(met("regressor.against_ar2"), (Some(0.9375), Some(false)));
        assert_eq!(met("regressor.spectrum"), (Some(0.75), Some(true)));
        assert_eq!(met("regressor.energy"), (Some(0.7), Some(false)));
        assert_eq!(met("regressor.rest"), (None, None), "not measured is not met and not missed");
    }

    #[test]
    fn the_recurrent_unit_has_to_earn_its_share_on_validation() {
        let mut m = metrics();
        assert_eq!(acceptance(&m)["regressor.gru_share"].met, None);
        m.validation_soft_ratio = [(OURS.to_owned(), 0.56), (without_gru(OURS), 0.58)].into();
        let gate = acceptance(&m)["regressor.gru_share"].clone();
        assert!((gate.value.unwrap() - 0.034_48).abs() < 1e-5 && gate.met == Some(true), "{gate:?}");
        m.validation_soft_ratio.insert(OURS.into(), 0.57);
        assert_eq!(acceptance(&m)["regressor.gru_share"].met, Some(false));
    }

    #[test]
    fn the_run_s_own_method_is_judged() {
        let mut m = metrics();
        m.method = Some("ar2-subject".into());
        assert_eq!(acceptance(&m)["regressor.soft_ratio"].value, Some(0.60));
        m.method = Some("dyna".into());
        assert_eq!(acceptance(&m)["regressor.soft_ratio"].value, None);
    }

    #[test]
    fn memory_is_allowed_by_the_size_of_the_mesh() {
        let mut m = metrics();
        m.components_95 = Some(ComponentMetrics { scan: Some(41), truth: Some(19) });
        m.peak_memory_bytes = Some(3 << 30);
        m.data.vertices = 1724;
        let gates = acceptance(&m);
        assert_eq!((gates["run.peak_memory"].value, gates["run.peak_memory"].met), (Some(3.0), Some(false)));
        assert_eq!((gates["data.scan_components"].met, gates["data.true_components"].met), (Some(true), Some(false)));
        m.data.vertices = 6890;
        assert_eq!(acceptance(&m)["run.peak_memory"].met, Some(true));
    }

    #[test]
    fn a_size_where_pca_was_kept_is_missed() {
        let mut m = metrics();
        let row =
            SubspaceMetrics { pca_mm: Some(1.0), ae_mm: Some(1.0), residual_kept: Some(false), ..Default::default() };
        m.subspace.insert(50, row);
        m.subspace.insert(25, SubspaceMetrics { residual_kept: Some(true), ae_mm: Some(0.9), ..row });
        let gates = acceptance(&m);
        assert_eq!(gates["subspace.50"].met, Some(false));
        assert_eq!(gates["subspace.25"].met, Some(true));
        assert_eq!(gates["subspace.100"].met, None);
    }

    #[test]
    fn a_region_that_does_not_ring_misses_the_decay() {
        let mut m = metrics();
        let ours = m.methods.get_mut(OURS).unwrap();
        ours.decay_hz_error = Some(0.1);
        assert_eq!(acceptance(&m)["regressor.decay_hz"].met, Some(true));
        m.methods.get_mut(OURS).unwrap().decay_missing = Some(1);
        assert_eq!(acceptance(&m)["regressor.decay_hz"].met, Some(false));
    }
}
