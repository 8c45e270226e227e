use crate::TrainingClip;
use rayon::prelude::*;
use softtissue_bundle::{Regressor, Subspace};
use softtissue_clips::ClipId;

/// A regressor that knows one person.
#[derive(Clone, Debug)]
pub struct SubjectRegressor {
    /// Who.
    pub subject: String,
    /// Shape coefficients.
    pub beta: Vec<f32>,
    /// Learned from that person's clips alone.
    pub regressor: Regressor,
}

/// Motion transfer (SoftSMPL sec. 5.2, eq. 16): every clip played by every other person. The motion stays as it is; shape
/// and deltas become what that person's own regressor `RB` gives for it, from rest. Features are limited to what `RB` has
/// seen in training, as in the player. Clips come out person after person, each in the order of `clips`.
pub fn transferred(subspace: &Subspace, people: &[SubjectRegressor], clips: &[TrainingClip]) -> Vec<TrainingClip> {
    let pairs = people.iter().flat_map(|b| clips.iter().filter(|a| a.id.subject != b.subject).map(move |a| (a, b)));
    pairs.collect::<Vec<_>>().into_par_iter().map(|(a, b)| transfer(subspace, a, b)).collect()
}

fn transfer(subspace: &Subspace, clip: &TrainingClip, person: &SubjectRegressor) -> TrainingClip {
    let k = subspace.components();
    let mut coefficients = vec![0.0; clip.frames * k];
    let (mut state, mut scratch) = (person.regressor.start(&person.beta), subspace.scratch());
    for (features, c) in clip.features.chunks_exact(clip.feature_count()).zip(coefficients.chunks_exact_mut(k)) {
        person.regressor.step(features, &mut state);
        subspace.decode_coefficients(state.latent(), c, &mut scratch);
    }
    let ClipId { subject, motion, take } = &clip.id;
    TrainingClip {
        id: ClipId::new(&person.subject, format!("{motion}-of-{subject}"), *take),
        beta: person.beta.clone(),
        features: clip.features.clone(),
        coefficients,
        frames: clip.frames,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softtissue_bundle::descriptor::{FeatureBlock, FeatureScaling};
    use softtissue_bundle::{Decoder, DeltaBasis, Linear, Matrix};

    /// Deltas are `gain * feature` on one component.
    fn person(subject: &str, gain: f32) -> SubjectRegressor {
        let seen = FeatureScaling::fit(&[&[-1.0, 1.0]], &FeatureBlock::in_a_row(&[("x", 1)]));
        let shortcut = Linear { weight: Matrix::new(1, 1, vec![gain]), bias: vec![0.0] };
        let regressor =
            Regressor { input: seen, shape_terms: vec![vec![]], direct: true, shortcut, ..Default::default() };
        SubjectRegressor { subject: subject.into(), beta: vec![gain], regressor }
    }

    fn clip(subject: &str, features: &[f32]) -> TrainingClip {
        TrainingClip {
            id: ClipId::new(subject, "hips", 1),
            beta: vec![9.0],
            features: features.to_vec(),
            coefficients: vec![7.0; features.len()],
            frames: features.len(),
        }
    }

    #[test]
    fn everybody_plays_everybody_elses_clips_with_their_own_flesh() {
        let subspace = Subspace {
            basis: DeltaBasis { mean: vec![0.0; 3], directions: Matrix::zeros(1, 3), coefficient_mean: vec![0.0] },
            decoder: Decoder { lift: Linear { weight: Matrix::new(1, 1, vec![2.0]), bias: vec![0.0] }, units: vec![] },
            ..Default::default()
        };
        let people = [person("a", 1.0), person("b", 10.0)];
        let clips = [clip("a", &[0.5, -0.25]), clip("b", &[1.0]), clip("c", &[3.0])];
        let found = transferred(&subspace, &people, &clips);
        let names: Vec<String> = found.iter().map(|c| c.id.to_string()).collect();
        assert_eq!(names, ["a/hips-of-b.1", "a/hips-of-c.1", "b/hips-of-a.1", "b/hips-of-c.1"]);
        assert_eq!(found[2].coefficients, [10.0, -5.0]);
        assert_eq!(
            (found[2].beta.as_slice(), found[2].features.as_slice()),
            ([10.0].as_slice(), [0.5, -0.25].as_slice())
        );
        // c's motion goes beyond what b's regressor has seen
        assert_eq!(found[3].coefficients, [20.0]);
    }
}
