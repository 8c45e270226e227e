use crate::accumulate::{Sums, Surface};
use crate::cross::Cross;
use crate::normal::{Correctives, Normal, reduce};
use crate::packed::PackedBody;
use crate::pose_state::{Kinematics, PoseState};
use crate::{ObjectiveKind, Result};
use glam::Vec3;
use softtissue_body::{Pose, ShapedBody};
use std::sync::Arc;

/// Fit weights made ready: sorted, summing to one, with the Gram matrix of the pose blendshapes under them.
#[derive(Clone, Debug)]
pub struct WeightedBody {
    pub(crate) packed: Arc<PackedBody>,
    pub(crate) weights: Arc<Vec<f32>>,
    pub(crate) gram: Arc<Vec<f64>>,
}

impl WeightedBody {
    /// Joins a body and weights `[V]` in the mesh's order; they need not be normalised. Panics unless the weights
    /// are positive.
    pub fn new(packed: Arc<PackedBody>, fit_weight: &[f32]) -> Self {
        assert!(fit_weight.iter().all(|w| *w > 0.0 && w.is_finite()), "fit weights are positive");
        let total: f64 = fit_weight.iter().map(|w| f64::from(*w)).sum();
        let scaled: Vec<f32> = packed.sorted(fit_weight).iter().map(|w| (f64::from(*w) / total) as f32).collect();
        let gram = Arc::new(packed.gram(&scaled));
        Self { packed, weights: Arc::new(scaled), gram }
    }
}

/// The pose objective of one subject: weighted mean squared distance, m^2, between scan and body, at rest
/// (Casas-Otaduy 2018 eq. 4) or in space (SoftSMPL eq. 4).
#[derive(Clone, Debug)]
pub struct Objective {
    pub(crate) body: WeightedBody,
    pub(crate) kind: ObjectiveKind,
    /// Sorted, with the subject template.
    pub(crate) rest: Vec<Vec3>,
    pub(crate) joints: Vec<Vec3>,
    /// Weight of the squared turn since the frame before.
    pub(crate) smoothness: f64,
    /// Weight of each joint's squared turn from rest, `[J]`; empty when there is none.
    pub(crate) pose_prior: Vec<f64>,
}

impl Objective {
    /// The objective for a shaped body and, if given, the static detail `[V]` on it.
    pub fn new(body: WeightedBody, kind: ObjectiveKind, shaped: &ShapedBody, template: Option<&[Vec3]>) -> Self {
        let mut rest = body.packed.sorted(&shaped.vertices);
        if let Some(template) = template {
            rest.iter_mut().zip(body.packed.sorted(template)).for_each(|(x, d)| *x += d);
        }
        Self { body, kind, rest, joints: shaped.joints.clone(), smoothness: 0.0, pose_prior: vec![] }
    }

    /// The same with priors: on each joint's squared turn from rest (the root's excepted), `pose_prior` times what that
    /// joint moves; and on its squared turn since the frame before, `smoothness` m^2/rad^2.
    pub fn with_priors(mut self, pose_prior: f64, smoothness: f64) -> Self {
        self.pose_prior =
            if pose_prior > 0.0 { self.inertia().iter().map(|h| pose_prior * h).collect() } else { vec![] };
        self.smoothness = smoothness;
        self
    }

    /// Weighted mean squared distance from each joint of the vertices that hang below it, `[J]`, m^2.
    pub(crate) fn inertia(&self) -> Vec<f64> {
        let mut inertia = vec![0.0; self.joints.len()];
        for ((bones, weight), rest) in self.body.packed.influences.iter().zip(self.body.weights.iter()).zip(&self.rest)
        {
            for (bone, b) in bones.iter() {
                let mut at = Some(bone);
                while let Some(j) = at {
                    inertia[j] += f64::from(b * weight * rest.distance_squared(self.joints[j]));
                    at = self.body.packed.parents[j];
                }
            }
        }
        inertia
    }

    /// The objective at a pose without its priors, m^2; `scan` is `[V]` in the mesh's order.
    pub fn value(&self, pose: Pose, scan: &[Vec3]) -> f64 {
        let kinematics = self.kinematics(&PoseState::from_pose(pose));
        self.surface().value(&kinematics, &self.body.packed.sorted(scan))
    }

    /// Rest-frame displacement of a scan beyond this objective's rest mesh and pose correctives, `[V]` in the mesh's
    /// order, and the vertices that the pose folds, whose displacement is taken along with their strongest bone.
    pub(crate) fn deltas(&self, state: &PoseState, sorted_scan: &[Vec3]) -> (Vec<Vec3>, Vec<u32>) {
        let kinematics = self.kinematics(state);
        let surface = Surface { kind: ObjectiveKind::Unposed, ..self.surface() };
        let residuals = surface.residuals(&kinematics, sorted_scan);
        let folded = surface.folded(&kinematics);
        (self.body.packed.unsorted(&residuals), folded)
    }

    pub(crate) fn kinematics(&self, state: &PoseState) -> Kinematics {
        Kinematics::new(&self.body.packed.parents, &self.joints, state)
    }

    pub(crate) fn surface(&self) -> Surface<'_> {
        let (packed, weights) = (&*self.body.packed, self.body.weights.as_slice());
        Surface { packed, kind: self.kind, rest: &self.rest, weights, shape_directions: &[] }
    }

    /// Value, gradient and Gauss-Newton matrix at a pose; `scan` sorted.
    pub(crate) fn normal(&self, kinematics: &Kinematics, scan: &[Vec3], cross: &Cross, sums: &mut Sums) -> Normal {
        self.surface().accumulate(kinematics, scan, sums);
        let correctives = Correctives { gram: &self.body.gram, cross, with_shape: &[] };
        reduce(&self.body.packed.parents, kinematics, sums, correctives, &vec![])
    }
}

/// Checks that a frame has as many vertices as the body and only finite numbers.
pub(crate) fn check_frame(clip: &str, frame: usize, scan: &[Vec3], body_vertices: usize) -> Result<()> {
    if scan.len() != body_vertices {
        return Err(crate::FitError::VertexCount { scans: scan.len(), body: body_vertices });
    }
    match scan.iter().position(|p| !p.is_finite()) {
        Some(vertex) => Err(crate::FitError::NotFinite { clip: clip.to_owned(), frame, vertex }),
        None => Ok(()),
    }
}
