use super::{normals, relative_difference, tensor};
use burn::module::Module;
use burn::nn::LinearConfig;
use burn::optim::{AdamConfig as PlainAdamConfig, GradientsParams};
use burn::tensor::Device;
use softtissue_model::host;
use softtissue_train::{Adam, AdamConfig, State, TrainError, load_module, module_gradients, module_state};

#[test]
fn fused_steps_equal_burns() {
    let device = Device::flex().autodiff();
    let start = LinearConfig::new(30, 20).init(&device);
    let (mut ours, mut theirs) = (start.clone(), start.clone());
    let mut fused = Adam::new(AdamConfig::default());
    let mut plain = PlainAdamConfig::new().with_epsilon(1e-8).init();
    for step in 0..25 {
        let x = tensor(normals(&format!("adam/{step}"), 8 * 30), [8, 30], &device);
        let rate = 1e-2 / (step + 1) as f64;
        let mut gradients = ours.forward(x.clone()).tanh().square().sum().backward();
        let gradients = module_gradients(&ours, &mut gradients);
        ours = fused.step(ours, &gradients, rate);
        let gradients = theirs.forward(x).tanh().square().sum().backward();
        let gradients = GradientsParams::from_grads(gradients, &theirs);
        theirs = plain.step(rate, theirs, gradients);
    }
    let difference = relative_difference(&host(ours.weight.val()), &host(theirs.weight.val()));
    assert!(difference < 2e-6, "{difference}");
    let moved = relative_difference(&host(ours.weight.val()), &host(start.weight.val()));
    assert!(moved > 0.05, "nothing was learned: {moved}");
}

#[test]
fn a_restored_optimiser_continues_to_the_same_bits() {
    let device = Device::flex().autodiff();
    let mut module = LinearConfig::new(5, 4).init(&device);
    let mut adam = Adam::new(AdamConfig::default());
    let step = |module: burn::nn::Linear, adam: &mut Adam, n: u64| {
        let x = tensor(normals(&format!("restore/{n}"), 15), [3, 5], &device);
        let mut gradients = module.forward(x).square().sum().backward();
        let gradients = module_gradients(&module, &mut gradients);
        adam.step(module, &gradients, 1e-2)
    };
    for n in 0..3 {
        module = step(module, &mut adam, n);
    }
    let saved: State = module_state(&module).into_iter().chain(adam.state()).map(|a| (a.name.clone(), a)).collect();
    let mut restored_adam = Adam::new(AdamConfig::default());
    restored_adam.load_state(&saved).expect("its own state");
    let mut restored = load_module(LinearConfig::new(5, 4).init(&device), &saved).expect("its own weights");
    for n in 3..6 {
        module = step(module, &mut adam, n);
        restored = step(restored, &mut restored_adam, n);
    }
    assert_eq!(module_state(&module), module_state(&restored));
    assert_eq!(adam.state(), restored_adam.state());
}

#[test]
fn a_state_of_another_network_is_refused() {
    let device = Device::flex().autodiff();
    let small = LinearConfig::new(5, 4).init(&device);
    let saved: State = module_state(&small).into_iter().map(|a| (a.name.clone(), a)).collect();
    let refused = |inputs| {
        let other = LinearConfig::new(inputs, 4).init(&device);
        load_module(other.no_grad(), &saved).map(|_| ())
    };
    assert!(refused(5).is_ok());
    match refused(6) {
        Err(TrainError::Config(text)) => assert!(text.contains("weight") && text.contains("[6, 4]"), "{text}"),
        other => panic!("{other:?}"),
    }
}
