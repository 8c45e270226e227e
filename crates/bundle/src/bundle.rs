use crate::descriptor::DescriptorConfig;
use crate::model::fits;
use crate::{Model, Player, Trust};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use softtissue_body::BodyModel;
use softtissue_geometry::Frames;

/// Everything that adds soft-tissue motion to a skeletal motion of one body model.
#[derive(Clone, Debug)]
pub struct Bundle {
    /// Where it came from and what it can do.
    pub info: BundleInfo,
    /// The body that moves.
    pub body: BodyModel,
    /// From poses to features.
    pub descriptor: DescriptorConfig,
    /// From features to deltas. The descriptor's modes are the first of the model's.
    pub model: Model,
    /// What training has seen.
    pub trust: Trust,
    /// A short input and its output.
    pub self_check: SelfCheck,
}

/// What a reader of the manifest wants to know.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundleInfo {
    /// Name of the method and its variant, as in metrics.
    pub method: String,
    /// Licence of the learned numbers, which follows that of the data.
    pub licence: String,
    /// Where the data came from: sets, subjects, clips, seeds, versions.
    pub provenance: serde_json::Value,
    /// Errors measured on clips that training had not seen.
    pub measured: serde_json::Value,
    /// Largest delta of a vertex in the training data, metres.
    pub largest_delta_m: f32,
}

/// A short motion and what the model made of it, run when a bundle is opened: it finds a player that computes
/// something else, be it through a bug or through flipped bits in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SelfCheck {
    /// Shape.
    pub beta: Vec<f32>,
    /// Joint rotations `[T, J]`, radians.
    pub rotations: Frames,
    /// Root translations `[T]`, metres.
    pub translations: Vec<Vec3>,
    /// Vertices whose deltas are kept, `[C]`, ascending.
    pub vertices: Vec<u32>,
    /// Deltas of these vertices `[T, C]`, metres.
    pub deltas: Frames,
}

/// Most frames of a self-check: it runs whenever a bundle is opened.
const LONGEST_CHECK: usize = 600;

impl SelfCheck {
    /// Plays a motion and keeps the deltas of `count` vertices spread evenly over those that it moves at all.
    pub fn record(
        bundle: &Bundle,
        beta: &[f32],
        rotations: &Frames,
        translations: &[Vec3],
        count: usize,
    ) -> crate::Result<Self> {
        let played = Player::new(bundle, beta)?.rollout(rotations, translations)?;
        let moves = |v: &usize| played.iter().any(|deltas| deltas[*v] != Vec3::ZERO);
        let moving: Vec<usize> = (0..bundle.body.vertex_count()).filter(moves).collect();
        let count = count.min(moving.len());
        let vertices: Vec<u32> = (0..count).map(|i| moving[i * moving.len() / count] as u32).collect();
        let mut deltas = Frames::new(count);
        for frame in played.iter() {
            let kept: Vec<Vec3> = vertices.iter().map(|v| frame[*v as usize]).collect();
            deltas.push(&kept);
        }
        Ok(Self {
            beta: beta.to_vec(),
            rotations: rotations.clone(),
            translations: translations.to_vec(),
            vertices,
            deltas,
        })
    }

    /// Largest departure allowed, metres: 10 micrometres and a thousandth of the largest delta, far under what is seen
    /// and above what the order of f32 sums changes.
    pub fn tolerance(&self) -> f32 {
        1e-5 + 1e-3 * self.deltas.points().iter().fold(0.0, |m: f32, d| m.max(d.length()))
    }

    /// Plays the motion again: the worst departure as (frame, place in `vertices`, metres).
    pub fn worst(&self, bundle: &Bundle) -> crate::Result<(usize, usize, f32)> {
        let mut worst = (0, 0, 0.0f32);
        Player::new(bundle, &self.beta)?.play(&self.rotations, &self.translations, |t, player| {
            for (i, (v, expected)) in self.vertices.iter().zip(self.deltas.frame(t)).enumerate() {
                let difference = player.deltas()[*v as usize].distance(*expected);
                // A departure that is no number is the worst there is.
                let difference = if difference.is_nan() { f32::INFINITY } else { difference };
                if difference > worst.2 {
                    worst = (t, i, difference);
                }
            }
            Ok(())
        })?;
        Ok(worst)
    }

    fn check(&self, body: &BodyModel) -> Result<(), String> {
        let t = self.translations.len();
        fits(
            "self-check rotations",
            &[self.rotations.len(), self.rotations.points_per_frame()],
            &[t, body.joint_count()],
        )?;
        fits("self-check deltas", &[self.deltas.len(), self.deltas.points_per_frame()], &[t, self.vertices.len()])?;
        if !(1..=LONGEST_CHECK).contains(&t) || self.vertices.is_empty() {
            return Err(format!("its self-check has {t} frames, expected 1 to {LONGEST_CHECK}; export it again"));
        }
        match self.vertices.iter().find(|v| **v as usize >= body.vertex_count()) {
            Some(v) => Err(format!("its self-check names vertex {v} of {}; export it again", body.vertex_count())),
            None => Ok(()),
        }
    }
}

impl Bundle {
    /// Whether all parts fit together; the sentence says what does not. Finite numbers are the reader's concern.
    pub fn check(&self) -> Result<(), String> {
        let Self { body, descriptor, model, .. } = self;
        model.check(descriptor)?;
        self.trust.check(model)?;
        if let Some(encoder) = model.recurrent().and_then(|m| m.pose_encoder.as_ref()) {
            encoder.check(body.joint_count()).map_err(|reason| format!("{reason}; export it again"))?;
        }
        fits("model, vertices", &[model.vertex_count()], &[body.vertex_count()])?;
        if descriptor.look_ahead > 600 {
            return Err(format!(
                "it looks {} frames ahead, expected at most 600; export it again",
                descriptor.look_ahead
            ));
        }
        self.self_check.check(body)
    }
}
