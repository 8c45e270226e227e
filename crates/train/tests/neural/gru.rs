use super::{normals, relative_difference, tensor};
use burn::module::{Module, Param};
use burn::nn::gru::GruConfig;
use burn::tensor::{Device, Tensor};
use softtissue_model::{Gru, host};
use softtissue_random::Draws;
use softtissue_train::{GradientMap, GruTrace, State, load_module, module_state};

/// See `golden/gru_reference.py`.
fn golden() -> serde_json::Value {
    serde_json::from_str(include_str!("../golden/gru_reference.json")).expect("the committed reference")
}

fn numbers(value: &serde_json::Value) -> Vec<f32> {
    value.as_array().expect("a list").iter().map(|x| x.as_f64().expect("a number") as f32).collect()
}

/// `[rows, cols]` to `[cols, rows]`: PyTorch keeps weights as `[outputs, inputs]`.
fn transposed(data: &[f32], cols: usize) -> Vec<f32> {
    let rows = data.len() / cols;
    (0..data.len()).map(|i| data[(i % rows) * cols + i / rows]).collect()
}

fn ours_from_torch(parameters: &serde_json::Value, inputs: usize, width: usize) -> GradientMap {
    let get = |name: &str| numbers(&parameters[name]);
    GradientMap::from([
        ("input_weight".into(), transposed(&get("weight_ih"), inputs)),
        ("hidden_weight".into(), transposed(&get("weight_hh"), width)),
        ("input_bias".into(), get("bias_ih")),
        ("hidden_bias".into(), get("bias_hh")),
    ])
}

#[test]
fn states_and_gradients_match_the_numpy_reference() {
    let device = Device::flex();
    let golden = golden();
    let size = |name: &str| golden[name].as_u64().expect("a size") as usize;
    let (frames, batch, inputs, width) = (size("frames"), size("batch"), size("inputs"), size("width"));
    let start = Gru::new(inputs, width, &mut Draws::new(0, "gru", 0, 0), &device);
    let weights = ours_from_torch(&golden["parameters"], inputs, width);
    let state: State = module_state(&start)
        .into_iter()
        .map(|mut array| {
            array.data = weights[&array.name].clone();
            (array.name.clone(), array)
        })
        .collect();
    let gru = load_module(start, &state).expect("the reference's shapes");
    let input = tensor(numbers(&golden["input"]), [frames, batch, inputs], &device);
    let states = numbers(&golden["states"]);
    assert!(relative_difference(&host(gru.forward(input.clone())), &states) < 1e-6);

    let trace = GruTrace::new(&gru, input);
    assert!(relative_difference(&host(trace.states()), &states) < 1e-6);
    let found = trace.backward(tensor(numbers(&golden["loss_weights"]), [frames * batch, width], &device), "");
    for (name, wanted) in ours_from_torch(&golden["gradients"], inputs, width) {
        let difference = relative_difference(&found[&name], &wanted);
        assert!(difference < 1e-5, "{name}: {difference}");
    }

    // The player's cell, frame by frame, is the same function.
    let plain = gru.to_plain();
    let input = numbers(&golden["input"]);
    for clip in 0..batch {
        let (mut hidden, mut scratch) = (vec![0.0; width], vec![0.0; 6 * width]);
        for t in 0..frames {
            plain.step(&input[(t * batch + clip) * inputs..][..inputs], &mut hidden, &mut scratch);
            assert!(relative_difference(&hidden, &states[(t * batch + clip) * width..][..width]) < 1e-5);
        }
    }
}

/// burn's own unit with our weights: gates in fields of their own.
fn burns(gru: &Gru, inputs: usize, width: usize, device: &Device) -> burn::nn::gru::Gru {
    let mut theirs = GruConfig::new(inputs, width, true).init(device);
    let gates = [&mut theirs.reset_gate, &mut theirs.update_gate, &mut theirs.new_gate];
    for (g, gate) in gates.into_iter().enumerate() {
        let part = g * width..(g + 1) * width;
        let matrix = |weight: &Param<Tensor<2>>, rows: usize| {
            Param::from_data(weight.val().inner().slice([0..rows, part.clone()]).into_data(), device)
        };
        let vector = |bias: &Param<Tensor<1>>| {
            Param::from_data(bias.val().inner().slice_dim(0, part.clone()).into_data(), device)
        };
        gate.input_transform.weight = matrix(&gru.input_weight, inputs);
        gate.hidden_transform.weight = matrix(&gru.hidden_weight, width);
        gate.input_transform.bias = Some(vector(&gru.input_bias));
        gate.hidden_transform.bias = Some(vector(&gru.hidden_bias));
    }
    theirs
}

#[test]
fn backpropagation_through_time_equals_burns_autodiff() {
    let (frames, batch, inputs, width) = (40, 4, 6, 16);
    let device = Device::flex().autodiff();
    let gru = Gru::new(inputs, width, &mut Draws::new(3, "gru", 0, 0), &device);
    let theirs = burns(&gru, inputs, width, &device);
    let input = normals("gru/input", frames * batch * inputs);
    let input = tensor(input, [frames, batch, inputs], &device);
    let weights = tensor(normals("gru/loss", frames * batch * width), [frames, batch, width], &device);

    let states = theirs.forward(input.clone().swap_dims(0, 1), None).swap_dims(0, 1);
    let trace = GruTrace::new(&gru, input);
    assert!(relative_difference(&host(trace.states()), &host(states.clone())) < 1e-5);
    // A loss that is not linear in the states.
    let mut gradients = (states.clone() * states.clone() * weights.clone()).sum().backward();
    let gradient = (states * weights * 2.0).inner().reshape([frames * batch, width]);
    let found = trace.backward(gradient, "gru.");

    let gates = [&theirs.reset_gate, &theirs.update_gate, &theirs.new_gate];
    for (g, gate) in gates.into_iter().enumerate() {
        let check = |name: &str, wanted: Option<Vec<f32>>| {
            let wanted = wanted.expect("a gradient");
            let columns = |all: &[f32]| -> Vec<f32> {
                all.chunks(3 * width).flat_map(|row| row[g * width..(g + 1) * width].to_vec()).collect()
            };
            let difference = relative_difference(&columns(&found[name]), &wanted);
            assert!(difference < 1e-4, "{name}, gate {g}: {difference}");
        };
        let layers = [("gru.input", &gate.input_transform), ("gru.hidden", &gate.hidden_transform)];
        for (name, layer) in layers {
            check(&format!("{name}_weight"), layer.weight.val().grad_remove(&mut gradients).map(host));
            let bias = layer.bias.as_ref().expect("a bias");
            check(&format!("{name}_bias"), bias.val().grad_remove(&mut gradients).map(host));
        }
    }
    assert_eq!(gru.num_params(), 3 * width * (inputs + width + 2));
}
