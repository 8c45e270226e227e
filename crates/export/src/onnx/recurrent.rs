use super::OnnxForm;
use super::graph::Graph;
use softtissue_bundle::descriptor::FeatureScaling;
use softtissue_bundle::{
    Gru, Hardening, Linear, Matrix, Recurrent, RecurrentModel, ResidualUnit, ResonatorBank, Subspace,
};
use std::iter::repeat_n;

/// The graph of a recurrent model of one body: what [`softtissue_bundle::Regressor::step`] and
/// [`softtissue_bundle::Subspace::decode`] compute.
pub(super) fn build(graph: &mut Graph, model: &RecurrentModel, beta: &[f32], form: OnnxForm) {
    let RecurrentModel { regressor, subspace, .. } = model;
    let body = regressor.of_body(beta);
    let features = graph.input("features", &[regressor.input.input_size], "the descriptor's features of a pose");
    let x = scaled(graph, &regressor.input, &features);

    let mut answers = vec![];
    if let Some(bank) = &body.bank {
        answers.push(resonators(graph, bank, &x));
    }
    if regressor.sees_features() {
        answers.push(x.clone());
    }
    let answers: Vec<&str> = answers.iter().map(String::as_str).collect();
    let memory = graph.node("answers", "Concat", &answers, &[("axis", 1)]);
    let latent = match &regressor.recurrent {
        None => graph.linear("latent", &body.shortcut, &memory),
        Some(recurrent) => {
            let shortcut = graph.linear("shortcut", &body.shortcut, &memory);
            let network = network(graph, recurrent, body.readout_gain, &body.shape, &x, form);
            graph.node("latent", "Add", &[&shortcut, &network], &[])
        }
    };
    graph.output("latent", &[regressor.latent_count()], "the few numbers behind the deltas");
    decoded(graph, subspace, &latent);
}

/// Kept features, clipped to their range in training and scaled, `[batch, K]`.
fn scaled(graph: &mut Graph, scaling: &FeatureScaling, features: &str) -> String {
    let kept: Vec<i64> = scaling.kept.iter().map(|k| i64::from(*k)).collect();
    let kept = graph.indices("input.kept", &kept);
    let size = [scaling.len()];
    let lower = graph.numbers("input.lower", &size, &scaling.lower);
    let upper = graph.numbers("input.upper", &size, &scaling.upper);
    let scale = graph.numbers("input.scale", &size, &scaling.scale);
    let chosen = graph.node("input.chosen", "Gather", &[features, &kept], &[("axis", 1)]);
    let raised = graph.node("input.raised", "Max", &[&chosen, &lower], &[]);
    let clipped = graph.node("input.clipped", "Min", &[&raised, &upper], &[]);
    graph.node("x", "Mul", &[&clipped, &scale], &[])
}

/// A step of the bank: with every real part's imaginary part fetched beside it (and the other way round), two products and
/// what comes in. Springs that harden keep their drive as the last number of the memory.
fn resonators(graph: &mut Graph, bank: &ResonatorBank, x: &str) -> String {
    let (c, n) = (bank.channels(), bank.outputs());
    let (mut partner, mut channel) = (vec![], vec![]);
    for p in 0..bank.poles().len() {
        for part in 0..2 {
            partner.extend((0..c).map(|i| (2 * p * c + (1 - part) * c + i) as i64));
            channel.extend((0..c).map(|i| i as i64));
        }
    }
    let size = [n + usize::from(bank.hardening().is_some())];
    let memory = graph.input("memory", &size, "memory_out of the frame before; zero before the first");
    let partner = graph.indices("bank.partner", &partner);
    let channel = graph.indices("bank.channel", &channel);
    let driven = graph.node("bank.driven", "Gather", &[x, &channel], &[("axis", 1)]);
    let (before, drive, input, Factors { own, other, gain }) = match bank.hardening() {
        None => (memory, None, driven, linear_factors(graph, bank)),
        Some(law) => {
            let places: Vec<i64> = (0..=n as i64).collect();
            let (states, last) = (graph.indices("bank.states", &places[..n]), graph.indices("bank.last", &places[n..]));
            let before = graph.node("bank.before", "Gather", &[&memory, &states], &[("axis", 1)]);
            let drive = graph.node("bank.drive_before", "Gather", &[&memory, &last], &[("axis", 1)]);
            let (drive, harder) = hardness(graph, law, bank, x, &drive);
            let input = graph.node("bank.yielding", "Div", &[&driven, &harder], &[]);
            (before, Some(drive), input, hardened_factors(graph, bank, &harder))
        }
    };
    let partners = graph.node("bank.partners", "Gather", &[&before, &partner], &[("axis", 1)]);
    let kept = graph.node("bank.kept", "Mul", &[&before, &own], &[]);
    let turned = graph.node("bank.turned", "Mul", &[&partners, &other], &[]);
    let input = graph.node("bank.input", "Mul", &[&input, &gain], &[]);
    let free = graph.node("bank.free", "Add", &[&kept, &turned], &[]);
    let answer = match drive {
        None => graph.node("memory_out", "Add", &[&free, &input], &[]),
        Some(drive) => {
            let answer = graph.node("bank.answer", "Add", &[&free, &input], &[]);
            graph.node("memory_out", "Concat", &[&answer, &drive], &[("axis", 1)]);
            answer
        }
    };
    graph.output("memory_out", &size, "memory of the next frame");
    answer
}

/// What each number of the bank, its partner and its input are multiplied by.
struct Factors {
    own: String,
    other: String,
    gain: String,
}

fn linear_factors(graph: &mut Graph, bank: &ResonatorBank) -> Factors {
    let (mut own, mut other, mut gain) = (vec![], vec![], vec![]);
    for &[a, b] in bank.poles() {
        for (turned, driven) in [(-b, 1.0 - a), (b, -b)] {
            own.extend(repeat_n(a, bank.channels()));
            other.extend(repeat_n(turned, bank.channels()));
            gain.extend(repeat_n(driven, bank.channels()));
        }
    }
    let size = [bank.outputs()];
    Factors {
        own: graph.numbers("bank.own", &size, &own),
        other: graph.numbers("bank.other", &size, &other),
        gain: graph.numbers("bank.gain", &size, &gain),
    }
}

/// The drive after a frame, `[batch, 1]`, and how hard it makes the springs, `[batch, 1]`.
fn hardness(graph: &mut Graph, law: Hardening, bank: &ResonatorBank, x: &str, before: &str) -> (String, String) {
    let c = bank.channels();
    let kept = law.kept(bank.fps());
    let channels: Vec<i64> = (0..c as i64).collect();
    let channels = graph.indices("bank.channels", &channels);
    let share = graph.numbers("bank.share", &[c, 1], &vec![(1.0 - kept) / c as f32; c]);
    let kept = graph.numbers("bank.drive_kept", &[1], &[kept]);
    let floor = graph.numbers("bank.floor", &[1], &[law.floor]);
    let nominal = graph.numbers("bank.nominal", &[1], &[1.0 + law.floor]);
    let exponent = graph.numbers("bank.exponent", &[1], &[0.5 * law.exponent]);
    let inputs = graph.node("bank.inputs", "Gather", &[x, &channels], &[("axis", 1)]);
    let squares = graph.node("bank.squares", "Mul", &[&inputs, &inputs], &[]);
    let fresh = graph.node("bank.drive_fresh", "MatMul", &[&squares, &share], &[]);
    let old = graph.node("bank.drive_old", "Mul", &[before, &kept], &[]);
    let drive = graph.node("bank.drive", "Add", &[&old, &fresh], &[]);
    let raised = graph.node("bank.raised", "Add", &[&drive, &floor], &[]);
    let beside = graph.node("bank.beside", "Div", &[&raised, &nominal], &[]);
    let harder = graph.node("bank.hardness", "Pow", &[&beside, &exponent], &[]);
    (drive, harder)
}

/// The factors of poles at `harder` times their frequencies.
fn hardened_factors(graph: &mut Graph, bank: &ResonatorBank, harder: &str) -> Factors {
    let (c, poles) = (bank.channels(), bank.poles().len());
    let turns: Vec<[f64; 2]> = bank.resonators().iter().map(|r| r.decay_and_angle(bank.fps())).collect();
    let row = |i: usize| turns.iter().map(|turn| turn[i] as f32).collect::<Vec<f32>>();
    let hardest: Vec<f32> = (0..poles).map(|p| bank.hardest(p)).collect();
    let decay = graph.numbers("bank.decay", &[poles], &row(0));
    let angle = graph.numbers("bank.angle", &[poles], &row(1));
    let hardest = graph.numbers("bank.hardest", &[poles], &hardest);
    let one = graph.numbers("bank.one", &[1], &[1.0]);
    let factor = graph.node("bank.factor", "Min", &[harder, &hardest], &[]);
    let decay = graph.node("bank.decays", "Mul", &[&factor, &decay], &[]);
    let angle = graph.node("bank.angles", "Mul", &[&factor, &angle], &[]);
    let radius = graph.node("bank.radius", "Exp", &[&decay], &[]);
    let cosine = graph.node("bank.cosine", "Cos", &[&angle], &[]);
    let sine = graph.node("bank.sine", "Sin", &[&angle], &[]);
    let a = graph.node("bank.real", "Mul", &[&radius, &cosine], &[]);
    let b = graph.node("bank.imaginary", "Mul", &[&radius, &sine], &[]);
    let minus = graph.node("bank.minus", "Neg", &[&b], &[]);
    let rest = graph.node("bank.rest", "Sub", &[&one, &a], &[]);
    let all = graph.node("bank.poles", "Concat", &[&a, &b, &minus, &rest], &[("axis", 1)]);
    // Where the factor of a real and of an imaginary part stands among the four.
    let mut spread = |name: &str, real: usize, imaginary: usize| {
        let places: Vec<i64> = (0..poles)
            .flat_map(|p| [real, imaginary].map(|part| repeat_n((part * poles + p) as i64, c)))
            .flatten()
            .collect();
        let places = graph.indices(&format!("bank.{name}_places"), &places);
        graph.node(&format!("bank.{name}"), "Gather", &[&all, &places], &[("axis", 1)])
    };
    Factors { own: spread("own", 0, 0), other: spread("other", 2, 1), gain: spread("gain", 3, 2) }
}

/// What the recurrent network adds to the latent.
fn network(graph: &mut Graph, recurrent: &Recurrent, gain: f32, shape: &[f32], x: &str, form: OnnxForm) -> String {
    let gru = &recurrent.gru;
    let width = gru.width();
    let hidden = graph.input("hidden", &[width], "hidden_out of the frame before; zero before the first");
    // A body's shape never changes: what it adds to the gates joins their biases.
    let (gru, inputs) = (of_shape(gru, shape), gru.inputs() - shape.len());
    match form {
        OnnxForm::Fused => fused(graph, &gru, inputs, x, &hidden),
        OnnxForm::Plain => plain(graph, &gru, x, &hidden),
    }
    graph.output("hidden_out", &[width], "hidden of the next frame");
    let Linear { weight, bias } = &recurrent.readout;
    let data = weight.numbers().iter().map(|w| gain * w).collect();
    let readout = Linear {
        weight: Matrix::new(weight.rows(), weight.cols(), data),
        bias: bias.iter().map(|b| gain * b).collect(),
    };
    graph.linear("readout", &readout, "hidden_out")
}

/// The unit without its shape inputs, which come last.
fn of_shape(gru: &Gru, shape: &[f32]) -> Gru {
    let inputs = gru.inputs() - shape.len();
    let mut b_ih = gru.b_ih.clone();
    let mut w_ih = Vec::with_capacity(gru.w_ih.rows() * inputs);
    for (row, bias) in b_ih.iter_mut().enumerate() {
        let weights = gru.w_ih.numbers_of_row(row);
        let (features, rest) = weights.split_at(inputs);
        w_ih.extend_from_slice(features);
        *bias += rest.iter().zip(shape).map(|(w, b)| w * b).sum::<f32>();
    }
    Gru { w_ih: Matrix::new(gru.w_ih.rows(), inputs, w_ih), b_ih, ..gru.clone() }
}

/// As the operator `GRU`, whose gates stand in the order update, reset, new.
fn fused(graph: &mut Graph, gru: &Gru, inputs: usize, x: &str, hidden: &str) {
    let width = gru.width();
    let gates = [1, 0, 2].map(|g| g * width..(g + 1) * width);
    let rows = |m: &Matrix| -> Vec<f32> {
        gates.iter().cloned().flatten().flat_map(|r| m.numbers_of_row(r).into_owned()).collect()
    };
    let biases = |b: &[f32]| -> Vec<f32> { gates.iter().flat_map(|g| b[g.clone()].to_vec()).collect() };
    let w = graph.numbers("gru.w", &[1, 3 * width, inputs], &rows(&gru.w_ih));
    let r = graph.numbers("gru.r", &[1, 3 * width, width], &rows(&gru.w_hh));
    let b = graph.numbers("gru.b", &[1, 6 * width], &[biases(&gru.b_ih), biases(&gru.b_hh)].concat());
    let axis = graph.indices("gru.axis", &[0]);
    let sequence = graph.node("gru.sequence", "Unsqueeze", &[x, &axis], &[]);
    let start = graph.node("gru.start", "Unsqueeze", &[hidden, &axis], &[]);
    graph.node_with(
        "gru",
        "GRU",
        &[&sequence, &w, &r, &b, "", &start],
        &["", "gru.last"],
        &[("hidden_size", width as i64), ("linear_before_reset", 1)],
    );
    graph.node("hidden_out", "Squeeze", &["gru.last", &axis], &[]);
}

/// Gate by gate: `h' = n + z (h - n)`.
fn plain(graph: &mut Graph, gru: &Gru, x: &str, hidden: &str) {
    let width = gru.width();
    let gate = |graph: &mut Graph, name: &str, g: usize| {
        let rows = g * width..(g + 1) * width;
        let part = |weight: &Matrix, bias: &[f32]| {
            let data = rows.clone().flat_map(|r| weight.numbers_of_row(r).into_owned()).collect();
            Linear { weight: Matrix::new(width, weight.cols(), data), bias: bias[rows.clone()].to_vec() }
        };
        let input = graph.linear(&format!("gru.{name}.input"), &part(&gru.w_ih, &gru.b_ih), x);
        let state = graph.linear(&format!("gru.{name}.state"), &part(&gru.w_hh, &gru.b_hh), hidden);
        (input, state)
    };
    let opened = |graph: &mut Graph, name: &str, g: usize| {
        let (input, state) = gate(graph, name, g);
        let sum = graph.node(&format!("gru.{name}.sum"), "Add", &[&input, &state], &[]);
        graph.node(&format!("gru.{name}"), "Sigmoid", &[&sum], &[])
    };
    let reset = opened(graph, "reset", 0);
    let update = opened(graph, "update", 1);
    let (input, state) = gate(graph, "new", 2);
    let kept = graph.node("gru.new.kept", "Mul", &[&reset, &state], &[]);
    let sum = graph.node("gru.new.sum", "Add", &[&input, &kept], &[]);
    let new = graph.node("gru.new", "Tanh", &[&sum], &[]);
    let change = graph.node("gru.change", "Sub", &[hidden, &new], &[]);
    let held = graph.node("gru.held", "Mul", &[&update, &change], &[]);
    graph.node("hidden_out", "Add", &[&new, &held], &[]);
}

/// From the latent to `deltas`.
fn decoded(graph: &mut Graph, subspace: &Subspace, latent: &str) {
    let mut coefficients = graph.linear("decoder.lift", &subspace.decoder.lift, latent);
    for (i, unit) in subspace.decoder.units.iter().enumerate() {
        coefficients = residual(graph, &format!("decoder.{i}"), unit, &coefficients);
    }
    let basis = &subspace.basis;
    let (k, n) = (basis.directions.rows(), basis.directions.cols());
    let centre = graph.numbers("basis.centre", &[k], &basis.coefficient_mean);
    let coefficients = graph.node("coefficients", "Add", &[&coefficients, &centre], &[]);
    let directions = graph.numbers("basis.directions", &[k, n], &basis.directions.numbers());
    let mean = graph.numbers("basis.mean", &[n], &basis.mean);
    let moved = graph.node("basis.moved", "MatMul", &[&coefficients, &directions], &[]);
    let flat = graph.node("basis.deltas", "Add", &[&moved, &mean], &[]);
    let shape = graph.indices("basis.shape", &[-1, (n / 3) as i64, 3]);
    graph.node("deltas", "Reshape", &[&flat, &shape], &[]);
    graph.output("deltas", &[n / 3, 3], "displacements of the rest mesh, metres");
}

/// `x + B relu(A relu(x) + a) + b`.
fn residual(graph: &mut Graph, name: &str, unit: &ResidualUnit, x: &str) -> String {
    let rectified = graph.node(&format!("{name}.rectified"), "Relu", &[x], &[]);
    let inner = graph.linear(&format!("{name}.inner"), &unit.inner, &rectified);
    let inner = graph.node(&format!("{name}.inner.rectified"), "Relu", &[&inner], &[]);
    let branch = graph.linear(&format!("{name}.outer"), &unit.outer, &inner);
    graph.node(name, "Add", &[x, &branch], &[])
}
