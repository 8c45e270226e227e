//! The autoencoder and the regressor of Casas and Otaduy against PyTorch, against the player, and as the loop sees them.

use super::{normals, relative_difference, tensor};
use burn::tensor::Device;
use serde_json::Value;
use softtissue_bundle::FeedbackModel;
use softtissue_model::{DeltaAutoencoder, PrincipalStart, Standardisation, host};
use softtissue_random::Draws;
use softtissue_train::{
    AutoencoderStart, Clips, DeltaAutoencoderTrainee, DeltaAutoencoderTraining, DeltaMetric, FeedbackClip,
    FeedbackGround, FeedbackTrainee, FeedbackTraining, NamedArray, Stage, State, Trainee,
};

/// See `golden/casas_otaduy_reference.py`.
fn golden() -> Value {
    serde_json::from_str(include_str!("../golden/casas_otaduy_reference.json")).expect("the committed reference")
}

fn numbers(value: &Value) -> Vec<f32> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number") as f32).collect()
}

fn count(value: &Value) -> usize {
    value.as_u64().expect("a count") as usize
}

fn stage(name: &str) -> Stage {
    Stage { name: name.into(), seed: 5, device: Device::flex() }
}

fn clips(golden: &Value) -> Vec<FeedbackClip> {
    let clip = |c: &Value| FeedbackClip { poses: numbers(&c["poses"]), deltas: numbers(&c["deltas"]) };
    golden["clips"].as_array().expect("clips").iter().map(clip).collect()
}

/// The trainee's state with the reference's weights and an optimiser without memory.
fn with_weights(trainee: &dyn Trainee, weights: &Value) -> State {
    let replace = |mut array: NamedArray| {
        if let Some(weights) = weights.get(&array.name) {
            array.data = numbers(weights);
        }
        (array.name.clone(), array)
    };
    trainee.state().into_iter().map(replace).collect()
}

fn steps_as_in(trainee: &mut dyn Trainee, reference: &Value) {
    let start = with_weights(trainee, &reference["start"]);
    trainee.load_state(&start).expect("the reference's shapes");
    for (step, wanted) in reference["losses"].as_array().expect("losses").iter().enumerate() {
        let (found, wanted) = (trainee.step(step as u64).expect("a step").loss, wanted.as_f64().expect("a loss"));
        assert!((found / wanted - 1.0).abs() < 1e-4, "step {step}: {found} {wanted}");
    }
    let mut compared = 0;
    for array in trainee.state().iter().filter(|a| reference["end"].get(&a.name).is_some()) {
        let difference = relative_difference(&array.data, &numbers(&reference["end"][&array.name]));
        assert!(difference < 2e-3, "{}: {difference}", array.name);
        compared += 1;
    }
    assert_eq!(compared, reference["end"].as_object().expect("weights").len());
    let (found, wanted) = (trainee.validate().expect("validation"), reference["validation_mm"].as_f64().expect("mm"));
    assert!((found / wanted - 1.0).abs() < 1e-3, "validation: {found} {wanted}");
}

fn autoencoder_like(golden: &Value) -> (DeltaAutoencoderTrainee, Standardisation) {
    let clips = clips(golden);
    let deltas = Standardisation::fit(clips.iter().map(|c| c.deltas.as_slice()), &[3 * count(&golden["vertices"])]);
    let all: Vec<f32> = clips.iter().flat_map(|c| c.deltas.clone()).collect();
    let reference = &golden["autoencoder"];
    let widths = numbers(&golden["widths"]);
    let config = DeltaAutoencoderTraining {
        widths: [widths[0] as usize, widths[1] as usize],
        start: AutoencoderStart::Random,
        metric: DeltaMetric::Vertices,
        steps: reference["steps"].as_u64().expect("steps"),
        batch: count(&reference["batch"]),
        learning_rate: reference["learning_rate"].as_f64().expect("a rate"),
        decay: true,
    };
    let frames = Clips { train: all.clone(), validation: all };
    let latents = count(&golden["latents"]);
    let trainee = DeltaAutoencoderTrainee::new(config, &stage("autoencoder"), latents, &deltas, None, frames);
    (trainee.expect("a small training"), deltas)
}

fn regressor_config(golden: &Value) -> FeedbackTraining {
    let reference = &golden["regressor"];
    let number = |key: &str| reference[key].as_f64().expect(key);
    FeedbackTraining {
        width: 0,
        pose_history: 2,
        weighted: true,
        steps: number("steps") as u64,
        batch: number("batch") as usize,
        learning_rate: number("learning_rate"),
        decay: true,
        dropout: 0.0,
        latent_noise: number("latent_noise"),
        pose_noise: number("pose_noise"),
        own_latents: number("own_latents"),
        rollout_every: number("rollout_every") as u64,
        clip_latents: true,
    }
}

/// On the reference's trained encoder.
fn regressor_like(golden: &Value, config: FeedbackTraining) -> FeedbackTrainee {
    let (mut autoencoder, deltas) = autoencoder_like(golden);
    let end = with_weights(&autoencoder, &golden["autoencoder"]["end"]);
    autoencoder.load_state(&end).expect("the reference's shapes");
    let clips = clips(golden);
    let ground = FeedbackGround {
        encoder: autoencoder.into_network().encoder,
        deltas,
        poses: Standardisation::fit(clips.iter().map(|c| c.poses.as_slice()), &[count(&golden["poses"])]),
        rigidity: numbers(&golden["rigidity"]),
    };
    let clips = Clips { train: clips.clone(), validation: clips };
    FeedbackTrainee::new(config, &stage("regressor"), ground, clips).expect("a small training")
}

#[test]
fn the_autoencoder_s_steps_are_those_of_pytorch() {
    let golden = golden();
    steps_as_in(&mut autoencoder_like(&golden).0, &golden["autoencoder"]);
}

#[test]
fn the_regressor_s_steps_and_rollouts_are_those_of_pytorch() {
    let golden = golden();
    let mut trainee = regressor_like(&golden, regressor_config(&golden));
    let hidden = trainee.state().into_iter().find(|a| a.name == "hidden.bias").expect("a hidden layer");
    assert_eq!(hidden.data.len(), count(&golden["hidden"]), "the root of inputs times outputs, rounded down");
    steps_as_in(&mut trainee, &golden["regressor"]);

    // The player's own arithmetic, frame by frame from rest, over whole clips.
    let model = FeedbackModel { people: vec![trainee.to_person("someone", &[0.1])] };
    for (clip, wanted) in clips(&golden).iter().zip(golden["regressor"]["rollout_m"].as_array().expect("clips")) {
        let mut state = model.start(&[]);
        let (poses, width) = (count(&golden["poses"]), 3 * count(&golden["vertices"]));
        let mut found = vec![0.0; clip.deltas.len()];
        for (pose, deltas) in clip.poses.chunks_exact(poses).zip(found.chunks_exact_mut(width)) {
            assert_eq!(model.step(pose, &mut state, deltas), 0, "training clips lie within their own range");
        }
        let difference = relative_difference(&found, &numbers(wanted));
        assert!(difference < 1e-3, "{difference}");
    }
}

/// What was trained in burn, run by the player's arithmetic, gives the trainee's own error to 1e-4.
#[test]
fn the_player_s_rollout_is_the_one_that_was_validated() {
    let golden = golden();
    for (clip_latents, pose_history) in [(true, 2), (false, 3)] {
        let config = FeedbackTraining { clip_latents, pose_history, weighted: false, ..regressor_config(&golden) };
        let mut trainee = regressor_like(&golden, config);
        (0..6).for_each(|step| {
            trainee.step(step).expect("a step");
        });
        let validated = trainee.validate().expect("validation");
        let model = FeedbackModel { people: vec![trainee.to_person("someone", &[])] };
        assert_eq!(model.people[0].pose_history(), pose_history);
        let (mut sum, mut vertices) = (0.0, 0);
        for clip in clips(&golden) {
            let mut state = model.start(&[]);
            let mut found = [0.0; 12];
            for (pose, wanted) in clip.poses.chunks_exact(4).zip(clip.deltas.chunks_exact(12)) {
                model.step(pose, &mut state, &mut found);
                for (f, w) in found.chunks_exact(3).zip(wanted.chunks_exact(3)) {
                    sum += f.iter().zip(w).map(|(f, w)| f64::from(f - w).powi(2)).sum::<f64>().sqrt();
                    vertices += 1;
                }
            }
        }
        let played = 1000.0 * sum / f64::from(vertices);
        assert!((played / validated - 1.0).abs() < 1e-4, "{played} {validated}");
    }
}

#[test]
fn both_resume_to_the_same_bits() {
    let golden = golden();
    let resumes = |make: &dyn Fn() -> Box<dyn Trainee>, cut: u64| {
        let mut unbroken = make();
        let wanted: Vec<f64> = (0..6).map(|s| unbroken.step(s).expect("a step").loss).collect();
        let mut first = make();
        let mut found: Vec<f64> = (0..cut).map(|s| first.step(s).expect("a step").loss).collect();
        let saved: State = first.state().into_iter().map(|a| (a.name.clone(), a)).collect();
        let mut second = make();
        second.load_state(&saved).expect("its own state");
        second.validate().expect("validation changes nothing");
        found.extend((cut..6).map(|s| second.step(s).expect("a step").loss));
        assert_eq!(found, wanted);
        assert_eq!(second.state(), unbroken.state());
    };
    resumes(&|| Box::new(autoencoder_like(&golden).0), 2);
    // At a renewal of the own latents, between two, and before the first.
    for cut in [1, 3, 4] {
        let config = FeedbackTraining { dropout: 0.3, ..regressor_config(&golden) };
        resumes(&|| Box::new(regressor_like(&golden, config.clone())), cut);
    }
}

#[test]
fn an_autoencoder_may_start_as_principal_component_analysis() {
    const WIDTH: usize = 12;
    const LATENTS: usize = 3;
    let device = Device::flex();
    let spread = [0.03f32, 0.02, 0.01];
    let deviation: Vec<f32> = (0..WIDTH).map(|i| 0.002 + 0.001 * i as f32).collect();
    // Directions along single coordinates and one across two, so that the answer is plain.
    let mut directions = vec![0.0; LATENTS * WIDTH];
    directions[4] = 1.0;
    directions[WIDTH + 7] = -1.0;
    (directions[2 * WIDTH], directions[2 * WIDTH + 1]) = (0.6, 0.8);
    let start = PrincipalStart { directions: &directions, spread: &spread, deviation: &deviation };
    let random = DeltaAutoencoder::new(WIDTH, [8, 7], LATENTS, &mut Draws::new(1, "ae", 0, 0), &device);
    let network = random.as_principal(start, LATENTS, &device);
    let standard = Standardisation { mean: vec![0.001; WIDTH], deviation: deviation.clone() };
    let metres: Vec<f32> = normals("principal", 5 * WIDTH).iter().map(|x| 0.01 * x).collect();
    let found = host(network.forward(tensor(standard.apply(&metres), [5, WIDTH], &device)));
    let [encoder, decoder] = network.to_plain(&standard);
    for (row, found) in metres.chunks_exact(WIDTH).zip(found.chunks_exact(WIDTH)) {
        let mut wanted = vec![0.0f32; WIDTH];
        for direction in directions.chunks_exact(WIDTH) {
            let c: f32 = direction.iter().zip(row).map(|(d, x)| d * (x - 0.001)).sum();
            wanted.iter_mut().zip(direction).for_each(|(w, d)| *w += c * d);
        }
        let centred: Vec<f32> = found.iter().zip(&deviation).map(|(x, s)| x * s).collect();
        assert!(relative_difference(&centred, &wanted) < 1e-5, "{centred:?} {wanted:?}");
        // The plain layers take and give metres.
        let (mut latent, mut rebuilt) = (vec![0.0; LATENTS], vec![0.0; WIDTH]);
        encoder.apply(row, &mut encoder.scratch(), &mut latent);
        decoder.apply(&latent, &mut decoder.scratch(), &mut rebuilt);
        let wanted: Vec<f32> = wanted.iter().map(|w| w + 0.001).collect();
        assert!(relative_difference(&rebuilt, &wanted) < 1e-4, "{rebuilt:?} {wanted:?}");
    }
}

/// A second-order oscillator driven by the pose, which one frame alone does not tell: the regressor has to use what it
/// fed back.
#[test]
fn free_rollouts_learn_an_oscillator() {
    /// Metres of each coordinate for a unit of the oscillator: one direction holds it all.
    const SHAPE: [f32; 6] = [0.01, 0.0, 0.005, -0.01, 0.002, 0.0];
    // Forced at a rate of so many radians a frame; it resonates at 0.39.
    let clip = |rate: f32, frames: usize| {
        let (mut x, mut v) = (0.0f32, 0.0f32);
        let mut clip = FeedbackClip::default();
        for t in 0..frames {
            let force = (rate * t as f32 + 10.0 * rate).sin();
            v += 0.2 * force - 0.15 * x - 0.1 * v;
            x += v;
            clip.poses.push(force);
            clip.deltas.extend(SHAPE.map(|s| s * x));
        }
        clip
    };
    let train: Vec<FeedbackClip> = [0.15, 0.25, 0.32, 0.45, 0.6, 0.9].map(|rate| clip(rate, 120)).to_vec();
    let deltas = Standardisation::fit(train.iter().map(|c| c.deltas.as_slice()), &[6]);
    let frames: Vec<f32> = train.iter().flat_map(|c| c.deltas.clone()).collect();
    let config = DeltaAutoencoderTraining { widths: [8, 8], ..Default::default() };
    let frames = Clips { train: frames.clone(), validation: frames };
    let length = SHAPE.iter().map(|s| s * s).sum::<f32>().sqrt();
    let (direction, spread) = (SHAPE.map(|s| s / length), [length]);
    let principal = Some((&direction[..], &spread[..]));
    let mut autoencoder =
        DeltaAutoencoderTrainee::new(config, &stage("ae"), 1, &deltas, principal, frames).expect("a small training");
    assert!(autoencoder.validate().expect("validation") < 1e-3, "one component holds it all");
    let ground = FeedbackGround {
        encoder: autoencoder.into_network().encoder,
        deltas,
        poses: Standardisation::fit(train.iter().map(|c| c.poses.as_slice()), &[1]),
        rigidity: vec![1.0; 2],
    };
    let config = FeedbackTraining {
        width: 32,
        steps: 600,
        learning_rate: 1e-2,
        pose_history: 2,
        dropout: 0.0,
        pose_noise: 0.0,
        own_latents: 0.0,
        ..Default::default()
    };
    let unseen = clip(0.37, 120);
    let lengths = unseen.deltas.chunks_exact(3).map(|d| d.iter().map(|x| f64::from(x * x)).sum::<f64>().sqrt());
    let body_alone = 1000.0 * lengths.sum::<f64>() / 240.0;
    let clips = Clips { train, validation: vec![unseen] };
    let mut trainee = FeedbackTrainee::new(config, &stage("oscillator"), ground, clips).expect("a small training");
    (0..600).for_each(|step| {
        trainee.step(step).expect("a step");
    });
    let end = trainee.validate().expect("validation");
    assert!(end < 0.4 * body_alone, "{end} of {body_alone}");
}

#[test]
fn what_does_not_fit_is_refused() {
    let golden = golden();
    let standard = Standardisation { mean: vec![0.0; 12], deviation: vec![1.0; 12] };
    let refused = |config, frames: Vec<f32>| {
        let frames = Clips { train: frames.clone(), validation: frames };
        let trainee = DeltaAutoencoderTrainee::new(config, &stage("a"), 3, &standard, None, frames);
        trainee.map(|_| ()).unwrap_err().to_string()
    };
    let random = DeltaAutoencoderTraining { start: AutoencoderStart::Random, ..Default::default() };
    assert!(refused(random.clone(), vec![0.0; 13]).contains("no frames of 12"));
    assert!(refused(DeltaAutoencoderTraining { batch: 0, ..random }, vec![0.0; 24]).contains("batches of 0"));
    assert!(refused(DeltaAutoencoderTraining::default(), vec![0.0; 24]).contains("principal components"));
    let mut trainee = regressor_like(&golden, regressor_config(&golden));
    let mut state: State = trainee.state().into_iter().map(|a| (a.name.clone(), a)).collect();
    let own = NamedArray { name: "own_latents".into(), shape: vec![2, 3], data: vec![0.0; 6] };
    state.insert(own.name.clone(), own);
    assert!(trainee.load_state(&state).unwrap_err().to_string().contains("own_latents holds 6"));
}
