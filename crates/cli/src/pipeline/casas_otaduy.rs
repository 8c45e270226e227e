//! Casas and Otaduy (2018): an autoencoder and a regressor that is fed back through it, for each person.

use super::bundle::{LearnedCodec, PersonalCodec, SubspaceCodec, ThreeLayerCodec};
use super::context::{Context, Place};
use super::learn::{LearnedModel, Material};
use super::softtissue::linear;
use crate::exit::UsageError;
use anyhow::Result;
use rayon::prelude::*;
use softtissue_bundle::descriptor::{Descriptor, DescriptorConfig, FeatureKind};
use softtissue_bundle::{FeedbackModel, FeedbackPerson, Model};
use softtissue_clips::ClipId;
use softtissue_eval::Codec;
use softtissue_geometry::Frames;
use softtissue_model::{DeltaAutoencoder, Pca, PcaConfig, Standardisation};
use softtissue_random::Draws;
use softtissue_train::{Clips, DeltaAutoencoderTrainee, FeedbackClip, FeedbackGround, FeedbackTrainee, Stage};
use std::collections::{BTreeMap, BTreeSet};

/// What is known of one person before anything is learned.
struct Person<'a> {
    name: &'a str,
    clips: Clips<Vec<FeedbackClip>>,
    deltas: Standardisation,
    poses: Standardisation,
    pca: Pca,
}

/// What was learned of one person.
struct LearnedPerson {
    person: FeedbackPerson,
    /// Principal components and autoencoder by latent size, and whether validation kept more than the former.
    codecs: BTreeMap<usize, (SubspaceCodec, ThreeLayerCodec, bool)>,
    fact: String,
}

/// Learns the networks of everyone who trains.
pub fn learn_casas_otaduy(context: &Context, place: &Place, material: &Material) -> Result<LearnedModel> {
    let config = DescriptorConfig { features: FeatureKind::Angles, ..context.config.descriptor.clone() };
    let descriptor = Descriptor::new(&config, material.body, None)?;
    let names = people(place, material);
    let mut learned = Vec::with_capacity(names.len());
    for &name in &names {
        let person = prepare(context, place, material, &descriptor, name)?;
        learned.push(learn_person(context, place, material, &person)?);
    }
    let mut facts =
        vec![("motion descriptor".to_owned(), format!("{:?}, {} features", config.features, descriptor.len()))];
    facts.extend(learned.iter().map(|l| (format!("networks of {}", l.person.name), l.fact.clone())));
    let mut codecs: BTreeMap<usize, PersonalCodecs> = BTreeMap::new();
    let mut people = Vec::with_capacity(learned.len());
    for LearnedPerson { person, codecs: own, .. } in learned {
        for (latents, (pca, autoencoder, kept)) in own {
            codecs.entry(latents).or_default().push(&person.name, pca, autoencoder, kept);
        }
        people.push(person);
    }
    let model = FeedbackModel { people };
    let soft_ratio = soft_ratio(&model, material, &descriptor, &names)?;
    Ok(LearnedModel {
        descriptor: config,
        model: Model::Feedback(model),
        ablations: vec![],
        soft_ratio,
        codecs: codecs.into_iter().map(|(latents, all)| all.into_codec(latents)).collect(),
        facts,
    })
}

/// Who gets networks: everyone who trains; in a protocol's fold those alone who are judged, if they train.
fn people<'a>(place: &Place, material: &Material<'a>) -> BTreeSet<&'a str> {
    let of = |ids: &'a [ClipId]| -> BTreeSet<&'a str> { ids.iter().map(|id| id.subject.as_str()).collect() };
    let (train, judged) = (of(&material.split.train), of(&material.split.test));
    let alone = !place.prefix.is_empty() && !judged.is_empty() && judged.is_subset(&train);
    if alone { judged } else { train }
}

/// Everyone's codecs of one latent size.
#[derive(Default)]
struct PersonalCodecs {
    pca: PersonalCodec,
    autoencoder: PersonalCodec,
    kept: bool,
}

impl PersonalCodecs {
    fn push(&mut self, name: &str, pca: SubspaceCodec, autoencoder: ThreeLayerCodec, kept: bool) {
        self.pca.0.insert(name.to_owned(), Box::new(pca));
        self.autoencoder.0.insert(name.to_owned(), Box::new(autoencoder));
        self.kept |= kept;
    }

    fn into_codec(self, latents: usize) -> LearnedCodec {
        let subjects = self.pca.0.keys().cloned().collect();
        let boxed = |codec: PersonalCodec| -> Box<dyn Codec> { Box::new(codec) };
        LearnedCodec {
            latents: latents as u32,
            pca: boxed(self.pca),
            autoencoder: boxed(self.autoencoder),
            residual_kept: self.kept,
            subjects: Some(subjects),
        }
    }
}

/// Reads a person's clips and learns what the networks are standardised by.
fn prepare<'a>(
    context: &Context,
    place: &Place,
    material: &Material,
    descriptor: &Descriptor,
    name: &'a str,
) -> Result<Person<'a>> {
    let Material { split, .. } = *material;
    let config = &context.config.casas_otaduy;
    let of = |ids: &[ClipId]| ids.iter().filter(|id| id.subject == name).cloned().collect::<Vec<_>>();
    let mut train = clips(&of(&split.train), material, descriptor, false)?;
    if config.mirror {
        train.extend(clips(&of(&split.train), material, descriptor, true)?);
    }
    let mut validation = clips(&of(split.selection()), material, descriptor, false)?;
    if validation.is_empty() {
        // Nothing of them was left out to select by.
        validation = clips(&of(&split.train), material, descriptor, false)?;
    }
    let kinds: Vec<usize> = descriptor.blocks().iter().map(|b| b.range.len()).collect();
    let width = 3 * material.body.vertex_count();
    let deltas = Standardisation::fit(train.iter().map(|c| c.deltas.as_slice()), &[width]);
    let poses = Standardisation::fit(train.iter().map(|c| c.poses.as_slice()), &kinds);
    let frames: Vec<Frames> =
        train.iter().map(|c| Frames::from_numbers(material.body.vertex_count(), &c.deltas)).collect();
    let components = config.sizes.iter().copied().max().unwrap_or(0);
    let pca_config = PcaConfig { components, ..context.config.subspace.pca.clone() };
    let stage = place.stage(&format!("casas-otaduy/{name}/components"));
    let mut draws = Draws::new(context.config.seed, &stage, 0, 0);
    let pca = Pca::fit(frames.as_slice(), &pca_config, &mut draws, context.monitor)?;
    Ok(Person { name, clips: Clips { train, validation }, deltas, poses, pca })
}

/// Features and deltas of clips, mirrored if asked for.
fn clips(ids: &[ClipId], material: &Material, descriptor: &Descriptor, mirrored: bool) -> Result<Vec<FeedbackClip>> {
    let Material { body, fit, .. } = *material;
    ids.par_iter()
        .map(|id| {
            let beta = fit.subject(&id.subject)?.beta;
            let motion = fit.motion(id)?;
            let deltas = fit.deltas(id)?.deltas;
            let (rotations, translations, deltas) = match mirrored {
                true => {
                    let (rotations, translations) = body.mirror.motion(&motion.rotations, &motion.translations);
                    (rotations, translations, body.mirror.fields(&deltas))
                }
                false => (motion.rotations, motion.translations, deltas),
            };
            let poses = descriptor.run(body, &body.shaped(&beta), &rotations, &translations);
            Ok(FeedbackClip { poses, deltas: deltas.to_numbers() })
        })
        .collect()
}

fn learn_person(context: &Context, place: &Place, material: &Material, person: &Person) -> Result<LearnedPerson> {
    let config = &context.config.casas_otaduy;
    let mut codecs = BTreeMap::new();
    let mut chosen = None;
    for &latents in &config.sizes {
        if latents > person.pca.components() {
            let (name, count) = (person.name, person.pca.components());
            context
                .monitor
                .say(&format!("  no autoencoder of {latents} numbers: {name}'s clips have {count} components"));
            continue;
        }
        let (network, best_step) = learn_autoencoder(context, place, person, latents)?;
        let [encoder, decoder] = network.to_plain(&person.deltas);
        let pca = SubspaceCodec(linear(&person.pca.basis, latents));
        codecs.insert(latents, (pca, ThreeLayerCodec { encoder, decoder }, best_step > 0));
        if latents == config.latents {
            chosen = Some((network, best_step));
        }
    }
    let Some((network, autoencoder_step)) = chosen else {
        return Err(UsageError(format!(
            "casas_otaduy.latents is {}, but {}'s clips have {} components only; choose fewer",
            config.latents,
            person.name,
            person.pca.components()
        ))
        .into());
    };
    let subject = material.fit.subject(person.name)?;
    let ground = FeedbackGround {
        encoder: network.encoder,
        deltas: person.deltas.clone(),
        poses: person.poses.clone(),
        rigidity: subject.rigidity_weight,
    };
    let name = format!("casas-otaduy/{}/regressor", person.name);
    context.timed(&place.stage(&name), || {
        let stage = stage(context, &name);
        let mut trainee = FeedbackTrainee::new(config.regressor.clone(), &stage, ground, person.clips.clone())?;
        let (best_step, best_mm) = context.train(place, &name, &mut trainee, config.regressor.steps)?;
        let fact = format!("autoencoder best at step {autoencoder_step}, regressor at {best_step}: {best_mm:.3} mm");
        Ok(LearnedPerson { person: trainee.to_person(person.name, &subject.beta), codecs, fact })
    })
}

/// The autoencoder of one size, and the step at which it was best: 0 where it stayed at its start.
fn learn_autoencoder(
    context: &Context,
    place: &Place,
    person: &Person,
    latents: usize,
) -> Result<(DeltaAutoencoder, u64)> {
    let config = &context.config.casas_otaduy.autoencoder;
    let name = format!("casas-otaduy/{}/autoencoder-{latents}", person.name);
    context.timed(&place.stage(&name), || {
        let frames = |clips: &[FeedbackClip]| clips.iter().flat_map(|c| c.deltas.iter().copied()).collect::<Vec<_>>();
        let frames = Clips { train: frames(&person.clips.train), validation: frames(&person.clips.validation) };
        let spread: Vec<f32> = person.pca.variances.iter().map(|v| v.sqrt() as f32).collect();
        let principal = (person.pca.basis.directions.data(), spread.as_slice());
        let mut trainee = DeltaAutoencoderTrainee::new(
            config.clone(),
            &stage(context, &name),
            latents,
            &person.deltas,
            Some(principal),
            frames,
        )?;
        let (best_step, _) = context.train(place, &name, &mut trainee, config.steps)?;
        Ok((trainee.into_network(), best_step))
    })
}

fn stage(context: &Context, name: &str) -> Stage {
    Stage { name: name.to_owned(), seed: context.config.seed, device: context.device.clone() }
}

/// Error on soft vertices over that of the body alone, on the clips that selected the networks of `names`: scan deltas,
/// fitted motions. Where there is none of theirs, on everyone's.
fn soft_ratio(
    model: &FeedbackModel,
    material: &Material,
    descriptor: &Descriptor,
    names: &BTreeSet<&str>,
) -> Result<f64> {
    let Material { body, fit, split, .. } = *material;
    let soft = body.regions.soft();
    let own: Vec<&ClipId> = split.selection().iter().filter(|id| names.contains(id.subject.as_str())).collect();
    let clips = if own.is_empty() { split.selection().iter().collect() } else { own };
    let sums = clips.par_iter().map(|id| -> Result<(f64, f64)> {
        let motion = fit.motion(id)?;
        let wanted = fit.deltas(id)?.deltas;
        let beta = fit.subject(&id.subject)?.beta;
        let features = descriptor.run(body, &body.shaped(&beta), &motion.rotations, &motion.translations);
        let mut state = model.start(&beta);
        let mut found = vec![0.0; 3 * body.vertex_count()];
        let (mut error, mut alone) = (0.0, 0.0);
        for (features, wanted) in features.chunks_exact(descriptor.len()).zip(wanted.iter()) {
            model.step(features, &mut state, &mut found);
            for v in &soft {
                let (v, d) = (*v as usize, wanted[*v as usize]);
                error += f64::from(d.distance(glam::Vec3::from_slice(&found[3 * v..])));
                alone += f64::from(d.length());
            }
        }
        Ok((error, alone))
    });
    let sums = sums.collect::<Result<Vec<_>>>()?;
    let (error, alone) = sums.iter().fold((0.0, 0.0), |(a, b), (error, alone)| (a + error, b + alone));
    Ok(error / alone)
}
