use super::{normals, relative_difference, tensor};
use burn::tensor::Device;
use softtissue_model::{Autoencoder, AutoencoderConfig, Dropout, host};
use softtissue_random::Draws;
use softtissue_train::{State, load_module, module_state};

const K: usize = 20;
const L: usize = 6;

fn untrained(device: &Device) -> Autoencoder {
    let config = AutoencoderConfig { width: 32, units: 2 };
    Autoencoder::new(&config, K, L, 0.03, &mut Draws::new(1, "autoencoder", 0, 0), device)
}

/// Every weight random, so that nothing hides behind a zero.
fn shaken(network: Autoencoder) -> Autoencoder {
    let shake = |mut array: softtissue_train::NamedArray| {
        let noise = normals(&array.name, array.data.len());
        array.data.iter_mut().zip(noise).for_each(|(w, n)| *w += 0.1 * n);
        (array.name.clone(), array)
    };
    let state: State = module_state(&network).into_iter().map(shake).collect();
    load_module(network, &state).expect("its own state")
}

#[test]
fn untrained_it_is_principal_component_analysis() {
    let device = Device::flex();
    let x = normals("coefficients", 9 * K);
    let output = host(untrained(&device).forward(tensor(x.clone(), [9, K], &device), None));
    for (found, wanted) in output.chunks(K).zip(x.chunks(K)) {
        assert_eq!(found[..L], wanted[..L]);
        assert!(found[L..].iter().all(|c| *c == 0.0));
    }
    // Dropout lies inside the branches, which are zero: it changes nothing either.
    let mut dropout = Dropout::new(Draws::new(1, "dropout", 0, 0), 0.5, &device);
    let dropped = untrained(&device).forward(tensor(x, [9, K], &device), Some(&mut dropout));
    assert_eq!(host(dropped), output);
}

#[test]
fn plain_layers_compute_the_same_in_metres() {
    let device = Device::flex();
    let network = shaken(untrained(&device));
    assert!(network.branch_rms() > 0.05);
    assert_eq!(network.scale, 0.03f32.log2().floor().exp2());
    let (encoder, decoder) = (network.to_encoder(), network.to_decoder());
    let metres: Vec<f32> = normals("plain", 4 * K).iter().map(|x| 0.03 * x).collect();
    let scaled: Vec<f32> = metres.iter().map(|x| x / network.scale).collect();
    let latents = network.encoder.forward(tensor(scaled, [4, K], &device), None);
    let output = host(network.decoder.forward(latents.clone(), None));
    let latents = host(latents);
    for (n, row) in metres.chunks(K).enumerate() {
        let mut coefficients = row.to_vec();
        let mut scratch = vec![0.0; 2 * K + 32];
        encoder.units.iter().for_each(|unit| unit.apply(&mut coefficients, &mut scratch));
        let mut latent = vec![0.0; L];
        encoder.project.apply(&coefficients, &mut latent);
        let wanted: Vec<f32> = latents[n * L..][..L].iter().map(|z| z * network.scale).collect();
        assert!(relative_difference(&latent, &wanted) < 1e-5);
        decoder.lift.apply(&latent, &mut coefficients);
        decoder.units.iter().for_each(|unit| unit.apply(&mut coefficients, &mut scratch));
        let wanted: Vec<f32> = output[n * K..][..K].iter().map(|c| c * network.scale).collect();
        assert!(relative_difference(&coefficients, &wanted) < 1e-5);
    }
}

#[test]
fn dropout_repeats_by_its_stream() {
    let device = Device::flex();
    let network = shaken(untrained(&device));
    let x = tensor(normals("dropout", 64 * K), [64, K], &device);
    let with = |seed: u64, rate: f64| {
        let mut dropout = Dropout::new(Draws::new(seed, "dropout", 0, 0), rate, &device);
        host(network.forward(x.clone(), Some(&mut dropout)))
    };
    assert_eq!(with(1, 0.3), with(1, 0.3));
    assert_ne!(with(1, 0.3), with(2, 0.3));
    assert_eq!(with(1, 0.0), host(network.forward(x.clone(), None)));
}

#[test]
fn dropout_keeps_the_mean() {
    let device = Device::flex();
    let config = AutoencoderConfig { width: 32, units: 1 };
    let start = Autoencoder::new(&config, K, L, 1.0, &mut Draws::new(2, "autoencoder", 0, 0), &device);
    let decoder = shaken(start).decoder;
    // A single unit is linear in its mask, so the mean over streams is the output without one.
    let latents = tensor(vec![0.5; L], [1, L], &device);
    let exact = host(decoder.forward(latents.clone(), None));
    let rounds = 4000;
    let mut mean = vec![0.0f32; K];
    for seed in 0..rounds {
        let mut dropout = Dropout::new(Draws::new(seed, "mean", 0, 0), 0.1, &device);
        let output = host(decoder.forward(latents.clone(), Some(&mut dropout)));
        mean.iter_mut().zip(output).for_each(|(m, o)| *m += o / rounds as f32);
    }
    assert!(relative_difference(&mean, &exact) < 0.01, "{}", relative_difference(&mean, &exact));
}
