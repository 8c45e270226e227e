//! The pose autoencoder against PyTorch (`golden/pose_autoencoder_reference.py`), and its trainee.

use super::{normals, relative_difference, tensor};
use burn::tensor::Device;
use glam::Vec3;
use softtissue_geometry::{axis_angle_from_rotation, rotation_from_axis_angle};
use softtissue_model::{PoseAutoencoder, PoseAutoencoderConfig, PoseFrames, host};
use softtissue_random::Draws;
use softtissue_train::{
    Clips, PoseTrainee, PoseTraining, Stage, State, Trainee, load_module, module_gradients, module_state,
};

fn numbers(value: &serde_json::Value) -> Vec<f32> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number") as f32).collect()
}

/// PyTorch keeps weights as `[outputs, inputs]`, we as `[inputs, outputs]`; `shape` is ours.
fn ours(golden: &serde_json::Value, name: &str, shape: &[usize]) -> Vec<f32> {
    let data = numbers(&golden[name]);
    match shape {
        [inputs, outputs] => (0..data.len()).map(|i| data[(i % outputs) * inputs + i / outputs]).collect(),
        _ => data,
    }
}

#[test]
fn reconstructions_and_gradients_match_pytorch() {
    let golden: serde_json::Value =
        serde_json::from_str(include_str!("../golden/pose_autoencoder_reference.json")).expect("the reference");
    let size = |name: &str| golden[name].as_u64().expect("a size") as usize;
    let (batch, k, angles, latents) = (size("batch"), size("components"), size("angles"), size("latents"));
    let config = PoseAutoencoderConfig { latents, width: size("width"), hidden: size("hidden") };
    let device = Device::flex().autodiff();
    let start = PoseAutoencoder::new(&config, k, angles, 1.0, &mut Draws::new(0, "pose", 0, 0), &device);
    let mut state: State = module_state(&start).into_iter().map(|a| (a.name.clone(), a)).collect();
    assert_eq!(state.len(), golden["parameters"].as_object().expect("parameters").len());
    for array in state.values_mut() {
        array.data = ours(&golden["parameters"], &array.name, &array.shape);
    }
    let network = load_module(start, &state).expect("the reference's shapes");
    let mesh = tensor(numbers(&golden["mesh_input"]), [batch, k], &device);
    let input = numbers(&golden["angle_input"]);
    let pose = tensor(input.clone(), [batch, angles], &device);

    let found = network.forward(mesh.clone(), pose.clone());
    for (name, output) in ["mesh_output", "pose_output"].iter().zip(&found) {
        assert!(relative_difference(&host(output.clone()), &numbers(&golden[*name])) < 1e-6, "{name}");
    }
    let wanted = numbers(&golden["pose_latent"]);
    assert!(relative_difference(&host(network.pose_encoder.forward(pose)), &wanted) < 1e-6);
    let losses = found.map(|output| ((output.clone() - mesh.clone()) * (output - mesh.clone())).sum());
    for (name, loss) in ["mesh_loss", "pose_loss"].iter().zip(&losses) {
        let wanted = golden[*name].as_f64().expect("a loss");
        assert!((f64::from(host(loss.clone())[0]) / wanted - 1.0).abs() < 1e-6, "{name}");
    }
    let [a, b] = losses;
    let gradients = module_gradients(&network, &mut (a + b).backward());
    for array in state.values() {
        let wanted = ours(&golden["gradients"], &array.name, &array.shape);
        let difference = relative_difference(&gradients[&array.name], &wanted);
        assert!(difference < 1e-5, "{}: {difference}", array.name);
    }

    // The player's encoder is the same function, whatever turn of the axis angle a rotation comes in.
    let (plain, mut p) = (network.to_encoder(), vec![0.0; latents]);
    let mut scratch = plain.scratch();
    for (row, wanted) in input.chunks(angles).zip(wanted.chunks(latents)) {
        let mut pose = vec![Vec3::new(0.3, 2.0, -1.0)];
        pose.extend(row.as_chunks::<3>().0.iter().map(|w| Vec3::from_array(*w)));
        assert!(pose[1..].iter().all(|w| w.length() < 3.1), "the reference's angles are under a half turn");
        plain.apply(&pose, &mut scratch, &mut p);
        assert!(relative_difference(&p, wanted) < 1e-4);
        pose[2] = pose[2] - std::f32::consts::TAU * pose[2].normalize();
        plain.apply(&pose, &mut scratch, &mut p);
        assert!(relative_difference(&p, wanted) < 1e-4);
    }
    assert!(plain.check(angles / 3 + 1).is_ok());
    assert!(plain.check(angles / 3).unwrap_err().contains("6 numbers come in"));
}

const LATENTS: usize = 2;
const COMPONENTS: usize = 6;

/// A mesh that two angles move, one of them a lot more; two more angles move nothing.
fn poses(name: &str, count: usize) -> PoseFrames {
    let draws = normals(name, 6 * count);
    let mut poses = PoseFrames { count, ..PoseFrames::default() };
    for x in draws.chunks(6) {
        let w = Vec3::new(0.5 * x[0], 0.5 * x[1], 0.2 * x[2]);
        let w = axis_angle_from_rotation(rotation_from_axis_angle(w));
        poses.angles.extend([w.x, w.y, w.z, x[3], x[4], x[5]]);
        let (a, b) = (w.x.sin(), w.y.sin());
        poses.coefficients.extend([2.0 * a, b, a * a, a * b, b * b, 0.0]);
    }
    poses
}

fn trainee() -> PoseTrainee {
    let config = PoseTraining {
        network: PoseAutoencoderConfig { latents: LATENTS, width: 32, hidden: 2 },
        epochs: 60,
        batch: 64,
        learning_rate: 5e-3,
        ..PoseTraining::default()
    };
    let stage = Stage { name: "pose".into(), seed: 5, device: Device::flex() };
    // six of the coordinates of two vertices
    let directions: Vec<f32> = (0..36).map(|i| if i % 7 == 0 { 1.0 } else { 0.0 }).collect();
    let clips = Clips { train: poses("train", 600), validation: poses("validation", 100) };
    PoseTrainee::new(config, &stage, &directions, clips).expect("a small training")
}

fn run(trainee: &mut PoseTrainee, steps: std::ops::Range<u64>) {
    steps.for_each(|s| assert!(trainee.step(s).expect("a step").loss.is_finite()));
}

#[test]
fn it_learns_what_moves_the_mesh_and_forgets_what_does_not() {
    let mut trainee = trainee();
    assert_eq!(trainee.steps(), 600);
    let before = trainee.validate().expect("validation");
    run(&mut trainee, 0..600);
    let after = trainee.validate().expect("validation");
    assert!(after < 0.2 * before, "{after} of {before}");
    // p hardly follows the three angles that move nothing
    let encoder = trainee.into_network().to_encoder();
    let mut scratch = encoder.scratch();
    let mut p = |w: Vec3, idle: Vec3| {
        let mut p = [0.0; LATENTS];
        encoder.apply(&[Vec3::ZERO, w, idle], &mut scratch, &mut p);
        glam::Vec2::from_array(p)
    };
    let rest = p(Vec3::ZERO, Vec3::ZERO);
    let moves = p(Vec3::X * 0.5, Vec3::ZERO).distance(rest).min(p(Vec3::Y * 0.5, Vec3::ZERO).distance(rest));
    let idle = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| p(Vec3::ZERO, axis * 0.5).distance(rest));
    assert!(idle.iter().all(|d| *d < 0.15 * moves), "{idle:?} of {moves}");
}

#[test]
fn a_stopped_training_ends_in_the_bytes_of_an_unbroken_one() {
    let state = |t: &PoseTrainee| -> State { t.state().into_iter().map(|a| (a.name.clone(), a)).collect() };
    let (mut unbroken, mut first, mut second) = (trainee(), trainee(), trainee());
    run(&mut unbroken, 0..25);
    // past the end of the first epoch
    run(&mut first, 0..13);
    second.load_state(&state(&first)).expect("its own state");
    run(&mut second, 13..25);
    assert_eq!(state(&second), state(&unbroken));
}

#[test]
fn poses_that_do_not_fit_are_refused() {
    let stage = Stage { name: "pose".into(), seed: 5, device: Device::flex() };
    let new = |train, validation, directions: usize| {
        let clips = Clips { train, validation };
        PoseTrainee::new(PoseTraining::default(), &stage, &vec![0.0; directions], clips).map(|_| ()).unwrap_err()
    };
    let good = poses("good", 4);
    let refused = new(good.clone(), PoseFrames::default(), 6 * COMPONENTS).to_string();
    assert!(refused.contains("to validate"), "{refused}");
    let short = PoseFrames { angles: vec![0.0; 5], ..good.clone() };
    assert!(new(good.clone(), short, 6 * COMPONENTS).to_string().contains("do not fit"));
    assert!(new(good.clone(), good, 7).to_string().contains("7 numbers"));
}
