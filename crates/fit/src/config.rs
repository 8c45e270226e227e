use crate::{FitError, Result};
use serde::{Deserialize, Serialize};

/// In which frame the residuals of the pose fit are measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ObjectiveKind {
    /// Casas-Otaduy 2018 eq. 4: distance at rest, after unposing the scan. What it minimises is what the deltas
    /// are made of.
    Unposed,
    /// SoftSMPL eq. 4: distance in space. A small distance there can be a large one after unposing.
    Posed,
}

/// What minimises the objective.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Levenberg-Marquardt with analytic derivatives: this crate.
    LevenbergMarquardt,
    /// Adam through automatic differentiation, for the poses of whole clips: the slow reference, which lives where the
    /// networks are trained. Shape, subject template and weights stay Levenberg-Marquardt's.
    Adam,
}

/// What the deltas pass through before they are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DeltaForm {
    /// Nothing: displacements of vertices, as DMPL and SoftSMPL have them.
    Vertices,
    /// Deformations of triangles and their stitching (Dyna 2015, eqs. 12 and 19), which smooth them.
    Triangles,
}

/// How the second solver is run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AdamFitConfig {
    /// First step size, radians and metres. Default 0.02.
    pub learning_rate: f64,
    /// Share of the step size that is left at the last iteration; it falls along a cosine. 1 keeps it, and Adam then
    /// circles the minimum. Default 0.
    pub final_share: f64,
    /// Iterations. Default 300.
    pub iterations: u64,
    /// Frames at a time; more take more memory. Default 32.
    pub batch: usize,
}

impl Default for AdamFitConfig {
    fn default() -> Self {
        Self { learning_rate: 0.02, final_share: 0.0, iterations: 300, batch: 32 }
    }
}

/// Settings of the fit. The defaults are measured on synthetic scans.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct FitConfig {
    /// Default `unposed`.
    pub objective: ObjectiveKind,
    /// What finds the clips' poses: `levenberg-marquardt` (default), or `adam`, the slow reference. Shape, subject
    /// template and weights are `levenberg-marquardt`'s always.
    pub solver: Solver,
    /// Whether what is static in a subject beyond the shape space is taken out of its deltas, and of the pose fit.
    /// `false` gives the papers' literal deltas. Default true.
    pub subject_template: bool,
    /// Whether the fit weights that the template's regions give are refined by how much each vertex moves in the
    /// first deltas. Default true.
    pub refine_weights: bool,
    /// Frames that the shape is fitted to, taken from the starts of the subject's training clips in turn; more
    /// average out more flesh and noise and cost linearly. Default 16.
    pub shape_frames: usize,
    /// Weight of `|beta|^2` beside the mean squared distance, m^2; larger draws the shape to the mean. Default 1e-7.
    pub shape_prior: f64,
    /// Every how-manieth frame the first pass fits, which only serves the subject template and the weights.
    /// Default 4.
    pub first_pass_stride: usize,
    /// Share of the first pass's frames, the slowest ones, that the subject template is the mean of. Default 0.4.
    pub template_share: f64,
    /// Frames at the start of each clip that shape and template of a subject without training clips come from.
    /// Default 24.
    pub new_subject_frames: usize,
    /// Weight of each joint's squared turn from rest, the root's excepted, as a share of the weighted mean squared
    /// distance of what hangs below the joint. What the surface hardly tells (how a twist is shared along the spine,
    /// or between collar and shoulder) is shared evenly; larger biases every joint towards rest. Default 5e-6.
    pub pose_prior: f64,
    /// Weight of the squared change of the joint angles since the frame before, m^2/rad^2 a joint, while frames are
    /// solved one by one; holds joints that a noisy scan hardly shows, and lags behind fast motion where it is more.
    /// Default 2e-6.
    pub smoothness: f64,
    /// When a clip's frames are solved together after they were solved one by one, accelerations cost something: a
    /// limb's joint that the surface sees with all that hangs on it is low-passed, without lag, at about this many Hz, a
    /// joint that it sees less at fewer. 0: accelerations of limbs are free. Default 50.
    pub limb_hz: f64,
    /// The same for spine, neck and collars. They move slowly, and what swings fast in them is flesh that the pose took
    /// up. Default 17.
    pub trunk_hz: f64,
    /// The same for the root's turn and place. With all three 0 the clip is left as it was solved frame by frame.
    /// Default 24.
    pub root_hz: f64,
    /// A frame is solved when the next step turns every joint by less than this, radians, and moves the root by less,
    /// metres. Default 5e-4.
    pub tolerance: f64,
    /// A frame is solved too when the next step promises to lower the objective by less than this share of it;
    /// smaller settles weakly seen joints (hands, the spine's twist) more closely and costs iterations. Default 5e-4.
    pub least_gain: f64,
    /// Iterations a frame at most. Default 30.
    pub max_iterations: usize,
    /// `vertices` (default), or `triangles`: the deltas become deformations of triangles (Dyna 2015, eq. 12) and are
    /// stitched together again before they are written. Poses, shapes and templates are the same for both.
    pub delta_form: DeltaForm,
    /// Of the triangle form: weight of the squared difference of neighbouring triangles' deformations beside the squared
    /// error of their edges, m^2. Small keeps the deltas, large smooths the scanner's noise and then the flesh away.
    /// Default 1e-8, which changes a delta by less than 0.1 mm.
    pub triangle_smoothness: f64,
    /// Weighted rms distance, metres, beyond which a clip is held to be of another body or in other units.
    /// Default 0.15.
    pub refuse_beyond: f64,
    /// How the solver `adam` is run.
    pub adam: AdamFitConfig,
}

impl Default for FitConfig {
    fn default() -> Self {
        Self {
            objective: ObjectiveKind::Unposed,
            solver: Solver::LevenbergMarquardt,
            subject_template: true,
            refine_weights: true,
            shape_frames: 16,
            shape_prior: 1e-7,
            first_pass_stride: 4,
            template_share: 0.4,
            new_subject_frames: 24,
            pose_prior: 5e-6,
            smoothness: 2e-6,
            limb_hz: 50.0,
            trunk_hz: 17.0,
            root_hz: 24.0,
            tolerance: 5e-4,
            least_gain: 5e-4,
            max_iterations: 30,
            delta_form: DeltaForm::Vertices,
            triangle_smoothness: 1e-8,
            refuse_beyond: 0.15,
            adam: AdamFitConfig::default(),
        }
    }
}

impl FitConfig {
    /// Whether the frames of a clip are solved together after they were solved one by one.
    pub fn solves_together(&self) -> bool {
        [self.limb_hz, self.trunk_hz, self.root_hz].iter().any(|hz| *hz != 0.0)
    }

    /// Refuses values that no fit can be made with.
    pub fn check(&self) -> Result<()> {
        let at_least_one = [
            ("shape_frames", self.shape_frames),
            ("first_pass_stride", self.first_pass_stride),
            ("new_subject_frames", self.new_subject_frames),
            ("max_iterations", self.max_iterations),
            ("adam.iterations", self.adam.iterations as usize),
            ("adam.batch", self.adam.batch),
        ];
        for (field, value) in at_least_one {
            if value == 0 {
                return Err(FitError::Config { field, value: "0".into(), remedy: "write at least 1" });
            }
        }
        let not_negative = [
            ("shape_prior", self.shape_prior),
            ("smoothness", self.smoothness),
            ("pose_prior", self.pose_prior),
            ("least_gain", self.least_gain),
        ];
        for (field, value) in not_negative {
            if !(value.is_finite() && value >= 0.0) {
                return Err(FitError::Config { field, value: value.to_string(), remedy: "write 0 or more" });
            }
        }
        for (field, hz) in [("limb_hz", self.limb_hz), ("trunk_hz", self.trunk_hz), ("root_hz", self.root_hz)] {
            if hz != 0.0 && !(1.0..=1e4).contains(&hz) {
                return Err(FitError::Config { field, value: hz.to_string(), remedy: "write 0, or 1 to 10000" });
            }
        }
        let positive = [
            ("tolerance", self.tolerance),
            ("refuse_beyond", self.refuse_beyond),
            ("triangle_smoothness", self.triangle_smoothness),
            ("adam.learning_rate", self.adam.learning_rate),
        ];
        for (field, value) in positive {
            if !(value.is_finite() && value > 0.0) {
                return Err(FitError::Config { field, value: value.to_string(), remedy: "write more than 0" });
            }
        }
        if !(self.template_share > 0.0 && self.template_share <= 1.0) {
            let (field, value) = ("template_share", self.template_share.to_string());
            return Err(FitError::Config { field, value, remedy: "write more than 0 and at most 1" });
        }
        if !(0.0..=1.0).contains(&self.adam.final_share) {
            let (field, value) = ("adam.final_share", self.adam.final_share.to_string());
            return Err(FitError::Config { field, value, remedy: "write 0 to 1" });
        }
        Ok(())
    }
}
