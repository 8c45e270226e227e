use glam::{Vec2, Vec3};
use softtissue_body::{
    BodyBuild, BodyModel, JointRegressor, Mirror, Region, RegionMap, Skeleton, SkinWeights, UvAtlas,
};
use softtissue_bundle::descriptor::{
    Descriptor, DescriptorConfig, DescriptorParts, FeatureKind, FeatureScaling, PoseEncoder,
};
use softtissue_bundle::*;
use softtissue_geometry::{Frames, Topology};
use softtissue_random::Draws;
use std::sync::Arc;

/// Levels of the column, four vertices each.
const LEVELS: usize = 6;

/// A square column of three joints and 26 vertices, mirror-symmetric, with random blendshapes.
pub fn body() -> BodyModel {
    let mut draws = Draws::new(3, "tiny body", 0, 0);
    let mut template: Vec<Vec3> = (0..LEVELS)
        .flat_map(|l| {
            [(0.2, 0.1), (-0.2, 0.1), (-0.2, -0.1), (0.2, -0.1)].map(|(x, z)| Vec3::new(x, 0.2 * l as f32, z))
        })
        .collect();
    let v = template.len() as u32 + 2;
    template.extend([Vec3::new(0.0, -0.05, 0.0), Vec3::new(0.0, 0.2 * LEVELS as f32 - 0.15, 0.0)]);
    let mut faces = vec![];
    for k in 0..4u32 {
        let next = (k + 1) % 4;
        for l in 0..LEVELS as u32 - 1 {
            let [a, b, c, d] = [4 * l + k, 4 * l + next, 4 * l + 4 + next, 4 * l + 4 + k];
            faces.extend([[a, c, b], [a, d, c]]);
        }
        let top = 4 * (LEVELS as u32 - 1);
        faces.extend([[v - 2, k, next], [v - 1, top + next, top + k]]);
    }
    let topology = Topology { vertex_count: v as usize, faces, quads: vec![] };
    assert_eq!(topology.check_closed_manifold(), Ok(0));
    let skin = (0..v as usize)
        .map(|i| {
            let height = template[i].y;
            let upper = ((height - 0.3) / 0.4).clamp(0.0, 1.0);
            let [a, b] = if upper > 0.5 { [1, 2] } else { [0, 1] };
            let w = if upper > 0.5 { upper - 0.5 } else { upper + 0.5 };
            let (joints, weights) = if w >= 0.5 { ([b, a, 0, 0], [w, 1.0 - w]) } else { ([a, b, 0, 0], [1.0 - w, w]) };
            SkinWeights { joints, weights: [weights[0], weights[1], 0.0, 0.0] }
        })
        .collect();
    let mut field = |count: usize, size: f64| -> Vec<Vec3> {
        (0..count * v as usize).map(|_| Vec3::from_array([0; 3].map(|_| draws.range(-size, size) as f32))).collect()
    };
    let swap = |i: u32| if i < v - 2 { i ^ 1 } else { i };
    BodyModel {
        shape_directions: field(2, 0.01),
        pose_directions: field(18, 0.003),
        joint_regressor: JointRegressor {
            rows: [0u32, 8, 16].map(|first| (first..first + 4).map(|i| (i, 0.25)).collect()).to_vec(),
        },
        skin,
        skeleton: Skeleton {
            names: ["root", "middle", "top"].map(str::to_owned).to_vec(),
            parents: vec![None, Some(0), Some(1)],
        },
        uv: UvAtlas {
            coordinates: template.iter().map(|p| Vec2::new(p.x + 0.5, p.y * 0.5 + 0.1)).collect(),
            faces: topology.faces.clone(),
        },
        mirror: Mirror { vertices: (0..v).map(swap).collect(), joints: vec![0, 1, 2] },
        regions: RegionMap((0..v).map(|i| if i < 4 { Region::Feet } else { Region::Belly }).collect()),
        template,
        topology: Arc::new(topology),
    }
}

/// What a test bundle holds.
#[derive(Clone, Copy, Debug)]
pub struct Parts {
    pub features: FeatureKind,
    pub bank: bool,
    pub hardening: bool,
    pub direct: bool,
    pub recurrent: bool,
    pub units: usize,
    pub look_ahead: usize,
    pub acquainted: bool,
}

impl Default for Parts {
    fn default() -> Self {
        Self {
            features: FeatureKind::ModalForces,
            bank: true,
            hardening: true,
            direct: true,
            recurrent: true,
            units: 2,
            look_ahead: 0,
            acquainted: false,
        }
    }
}

/// Random numbers without transcendental functions, so that they are the same everywhere.
struct Numbers(Draws);

impl Numbers {
    fn take(&mut self, count: usize, size: f64) -> Vec<f32> {
        (0..count).map(|_| self.0.range(-1.7 * size, 1.7 * size) as f32).collect()
    }
    fn linear(&mut self, inputs: usize, outputs: usize, size: f64) -> Linear {
        let weight = self.take(outputs * inputs, size / (inputs as f64).sqrt());
        Linear { weight: Matrix::new(outputs, inputs, weight), bias: self.take(outputs, 0.01) }
    }
    fn units(&mut self, count: usize, k: usize) -> Vec<ResidualUnit> {
        (0..count).map(|_| ResidualUnit { inner: self.linear(k, 9, 1.0), outer: self.linear(9, k, 0.5) }).collect()
    }
}

/// An encoder of the tiny body's poses to four numbers.
pub fn pose_encoder() -> Arc<PoseEncoder> {
    let mut draws = Numbers(Draws::new(12, "tiny encoder", 0, 0));
    Arc::new(PoseEncoder { layers: vec![draws.linear(6, 8, 1.0), draws.linear(8, 4, 1.0)] })
}

/// Of [`motion`] and people on either side of the mean.
fn trust(descriptor: &Descriptor, features: &[f32]) -> Trust {
    let clips = [SeenClip { motion: "bends", features }];
    Trust::fit(descriptor.blocks(), &clips, &[&[-1.0, -1.0], &[1.0, 1.0]])
}

/// A bundle of random numbers of sensible size: 7 components, 5 latents, 4 modes.
pub fn bundle(parts: Parts) -> Bundle {
    let body = body();
    let (v, k, l, h) = (body.vertex_count(), 7, 5, 6);
    let mut draws = Numbers(Draws::new(11, "tiny bundle", 0, 0));
    let (encoder_units, decoder_units) = (draws.units(parts.units, k), draws.units(parts.units, k));
    let encoder = Encoder { units: encoder_units, project: draws.linear(k, l, 1.0) };
    let decoder = Decoder { units: decoder_units, lift: draws.linear(l, k, 1.0) };
    let directions = Matrix::new(k, 3 * v, draws.take(k * 3 * v, 0.1));
    let basis = DeltaBasis { mean: draws.take(3 * v, 1e-3), directions, coefficient_mean: draws.take(k, 1e-2) };
    let subspace = Subspace { basis, encoder, decoder };
    let config =
        DescriptorConfig { features: parts.features, modes: 4, look_ahead: parts.look_ahead, ..Default::default() };
    let pose_encoder = (parts.features == FeatureKind::DisentangledPose).then(pose_encoder);
    let modes = Some(subspace.basis.directions.numbers());
    let given = DescriptorParts { modes, encoder: pose_encoder.as_ref() };
    let descriptor = Descriptor::with_parts(&config, &body, given).unwrap();
    let (rotations, translations) = motion(90);
    let training = descriptor.run(&body, &body.shaped(&[0.3]), &rotations, &translations);
    let input = FeatureScaling::fit(&[&training], descriptor.blocks());
    let shape = FeatureScaling {
        input_size: 2,
        kept: vec![0, 1],
        lower: vec![-2.0, -2.5],
        upper: vec![2.0, 3.0],
        scale: vec![0.5, 0.4],
    };
    let bank = parts.bank.then(|| {
        let resonators =
            [(2.0, 0.08), (5.0, 0.2), (9.0, 0.4)].map(|(frequency, damping)| Resonator { frequency, damping });
        let hardening = Hardening { exponent: 0.4, seconds: 0.05, floor: 0.1 };
        ResonatorBank::new(resonators.to_vec(), 4, config.fps).with_hardening(parts.hardening.then_some(hardening))
    });
    let d = input.len();
    let mut regressor = Regressor {
        input,
        shape,
        shape_terms: vec![vec![], vec![0, 1], vec![1, 2]],
        mass: MassLaw { frequency: 0.2, amplitude: -0.3, centre: -0.4, range: [-2.5, 3.0] },
        bank,
        direct: parts.direct,
        ..Default::default()
    };
    regressor.shortcut = draws.linear(3 * regressor.memory_count() + 2, l, 0.05);
    regressor.recurrent = parts.recurrent.then(|| {
        let (input, state) = (draws.linear(d + 2, 3 * h, 1.0), draws.linear(h, 3 * h, 1.0));
        let gru = Gru { w_ih: input.weight, w_hh: state.weight, b_ih: input.bias, b_hh: state.bias };
        Recurrent { gru, readout: draws.linear(h, l, 0.05) }
    });
    regressor.acquaintance = parts.acquainted.then(|| Acquaintance {
        around: draws.linear(d + 2, l, 0.05),
        share: 0.7,
        stranger: 0.2,
        people: Matrix::new(2, 2, vec![0.3, 0.4, -1.0, 1.2]),
    });
    let info = BundleInfo {
        method: "softtissue".into(),
        licence: "CC0-1.0".into(),
        largest_delta_m: 0.1,
        ..Default::default()
    };
    let model = Model::Recurrent(RecurrentModel { regressor, subspace, pose_encoder });
    let trust = trust(&descriptor, &training);
    let mut bundle = Bundle { info, body, descriptor: config, model, trust, self_check: SelfCheck::default() };
    bundle.self_check =
        SelfCheck::record(&bundle, &[0.5, -0.5], &rotations.slice(0..12), &translations[..12], 8).unwrap();
    bundle
}

/// A bundle of two people, one light, one heavy, with random networks: 5 latents, two poses.
pub fn feedback_bundle(clipped: bool) -> Bundle {
    let body = body();
    let (width, l, h) = (3 * body.vertex_count(), 5, 11);
    let config = DescriptorConfig { features: FeatureKind::Angles, ..Default::default() };
    let descriptor = Descriptor::new(&config, &body, None).unwrap();
    let (rotations, translations) = motion(90);
    let features = descriptor.run(&body, &body.shaped(&[0.3]), &rotations, &translations);
    let p = descriptor.len();
    let mut pose_limits = Limits::nothing(p);
    features.chunks_exact(p).for_each(|frame| pose_limits.widen(frame));
    let mut draws = Numbers(Draws::new(12, "tiny feedback", 0, 0));
    let mut person = |name: &str, beta: Vec<f32>| FeedbackPerson {
        name: name.into(),
        beta,
        encoder: ThreeLayers([draws.linear(width, 9, 20.0), draws.linear(9, 7, 1.0), draws.linear(7, l, 1.0)]),
        hidden: draws.linear(2 * l + 2 * p, h, 1.0),
        output: draws.linear(h, width, 0.02),
        pose_limits: pose_limits.clone(),
        latent_limits: clipped.then(|| Limits { lower: vec![-0.4; l], upper: vec![0.4; l] }),
    };
    let people = vec![person("light", vec![0.0, 1.5]), person("heavy", vec![0.0, -1.5])];
    let info = BundleInfo { method: "casas-otaduy".into(), largest_delta_m: 0.1, ..Default::default() };
    let model = Model::Feedback(FeedbackModel { people });
    let trust = trust(&descriptor, &features);
    let mut bundle = Bundle { info, body, descriptor: config, model, trust, self_check: SelfCheck::default() };
    bundle.self_check =
        SelfCheck::record(&bundle, &[0.5, -0.5], &rotations.slice(0..12), &translations[..12], 8).unwrap();
    bundle
}

/// The recurrent model of a bundle, to break it.
pub fn recurrent_of(bundle: &mut Bundle) -> &mut RecurrentModel {
    let Model::Recurrent(model) = &mut bundle.model else { panic!("a recurrent bundle") };
    model
}

/// The same body with a mixture of three people of random dynamics on 7 components, poles inside 0.9.
pub fn autoregressive() -> Bundle {
    let mut bundle = bundle(Parts { features: FeatureKind::Pose, ..Parts::default() });
    let RecurrentModel { regressor, subspace, .. } = recurrent_of(&mut bundle).clone();
    let (input, basis) = (regressor.input, subspace.basis);
    let (k, d) = (basis.directions.rows(), input.len());
    let mut draws = Numbers(Draws::new(12, "tiny people", 0, 0));
    let mut person = |i: usize| {
        let lags = (0..k).flat_map(|_| [1.2 + draws.take(1, 0.1)[0], -0.6 + draws.take(1, 0.05)[0]]).collect();
        let dynamics = Ar2 {
            lags: Matrix::new(k, 2, lags),
            weight: Matrix::new(k, d, draws.take(k * d, 1e-3)),
            bias: draws.take(k, 1e-3),
        };
        PersonDynamics { name: format!("s{i:02}"), bmi: [20.5, 24.0, 31.0][i], dynamics }
    };
    let people = (0..3).map(&mut person).collect();
    let build = BodyBuild { rooted_weight: vec![4.1, 0.05, -0.2], height: vec![1.7, 0.06, 0.0] };
    bundle.model = Model::Autoregressive(AutoregressiveModel { input, basis, build, tau: 2.0, people });
    bundle.info.method = "dyna".into();
    let (rotations, translations) = motion(12);
    bundle.self_check = SelfCheck::record(&bundle, &[0.5, -0.5], &rotations, &translations, 8).unwrap();
    bundle
}

/// The autoregressive model of a bundle, to break it.
pub fn autoregressive_of(bundle: &mut Bundle) -> &mut AutoregressiveModel {
    let Model::Autoregressive(model) = &mut bundle.model else { panic!("an autoregressive bundle") };
    model
}

/// Bends, turns and hops.
pub fn motion(frames: usize) -> (Frames, Vec<Vec3>) {
    let mut rotations = Frames::new(3);
    let mut translations = vec![];
    for t in 0..frames {
        let s = t as f32 / 60.0;
        rotations.push(&[
            Vec3::new(0.1 * (3.0 * s).sin(), 1.5 * s, 0.0),
            Vec3::new(0.4 * (11.0 * s).sin(), 0.2 * (5.0 * s).cos(), 0.1),
            Vec3::new(-0.3 * (17.0 * s).sin(), 0.0, 0.3 * (7.0 * s).sin()),
        ]);
        translations.push(Vec3::new(0.5 * s, (0.2 * (9.0 * s).sin()).max(0.0), 0.1 * (4.0 * s).cos()));
    }
    (rotations, translations)
}

/// Bends, turns and bounces, smoothly, at any time: a frame every `1 / fps` seconds.
pub fn swinging(s: f32) -> (Vec<Vec3>, Vec3) {
    let rotations = vec![
        Vec3::new(0.1 * (3.0 * s).sin(), 0.8 * s, 0.0),
        Vec3::new(0.4 * (11.0 * s).sin(), 0.2 * (5.0 * s).cos(), 0.1),
        Vec3::new(-0.3 * (17.0 * s).sin(), 0.0, 0.3 * (7.0 * s).sin()),
    ];
    (rotations, Vec3::new(0.5 * s, 0.04 * (14.0 * s).sin(), 0.1 * (4.0 * s).cos()))
}
