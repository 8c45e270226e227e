//! The slow reference of the pose fit: skinning as tensor operations, derivatives by autodiff, Adam. The analytic
//! fit is held against it; both minimise the same objective.

use crate::subspace_step::tensor;
use crate::{Adam, AdamConfig, Result, TrainError, cosine, module_gradients};
use burn::module::{Module, Param};
use burn::tensor::{Device, Tensor};
use glam::Vec3;
use softtissue_body::{BodyModel, SMALLEST_DETERMINANT, ShapedBody};
use softtissue_fit::{AdamFitConfig, ObjectiveKind};
use softtissue_geometry::Frames;
use softtissue_model::host;
use softtissue_monitor::Monitor;
use std::time::Instant;

/// Poses of `B` frames as they are being fitted, and how the fit went.
#[derive(Clone, Debug)]
pub struct AdamFit {
    /// Axis angles, `[B, J]`.
    pub rotations: Frames,
    /// Metres, `[B]`.
    pub translations: Vec<Vec3>,
    /// Objective of each frame before each iteration and after the last, `[iterations + 1][B]`, m^2.
    pub values: Vec<Vec<f64>>,
    /// Seconds since the start at each entry of `values`.
    pub seconds: Vec<f64>,
}

/// The pose objective of one subject as tensor operations: weighted mean squared distance, m^2, at rest
/// (Casas-Otaduy 2018 eq. 4) or in space (SoftSMPL eq. 4), and priors where they are asked for.
///
/// Tensors are planar: the coordinates of all vertices, not the vertices, lie together.
pub struct AdamPoseFit {
    kind: ObjectiveKind,
    parents: Vec<Option<usize>>,
    joints: Vec<Vec3>,
    /// Skin weights `[J, V]`, and those of the strongest bone alone.
    skin: Tensor<2>,
    strongest: Tensor<2>,
    /// Rest coordinates, `[1, V]` each.
    rest: [Tensor<2>; 3],
    /// Pose blendshapes, `[P, V]` for each coordinate.
    correctives: [Tensor<2>; 3],
    /// Summing to one, `[1, V]`.
    weights: Tensor<2>,
    /// Weight of each squared axis angle, `[1, J * 3]`, zero for the root's.
    pose_prior: Option<Tensor<2>>,
    /// Weight of each joint's squared turn since the frame before, m^2/rad^2.
    smoothness: f64,
    device: Device,
}

/// What is fitted.
#[derive(Module, Debug)]
struct Poses {
    /// Axis angles, `[B, J * 3]`.
    rotations: Param<Tensor<2>>,
    /// `[B, 3]`.
    translations: Param<Tensor<2>>,
}

impl AdamPoseFit {
    /// The objective for a shaped body and, if given, the static detail `[V]` on it; `fit_weight [V]` need not be
    /// normalised. `device` is a plain one.
    pub fn new(
        body: &BodyModel,
        shaped: &ShapedBody,
        template: Option<&[Vec3]>,
        fit_weight: &[f32],
        kind: ObjectiveKind,
        device: &Device,
    ) -> Self {
        let (v, j) = (body.vertex_count(), body.joint_count());
        assert_eq!((shaped.vertices.len(), fit_weight.len()), (v, v), "vertices of a pose fit");
        let device = device.clone().inner();
        let mut rest = shaped.vertices.clone();
        if let Some(template) = template {
            rest.iter_mut().zip(template).for_each(|(x, d)| *x += *d);
        }
        let (mut skin, mut strongest) = (vec![0.0; j * v], vec![0.0; j * v]);
        for (i, influence) in body.skin.iter().enumerate() {
            for (bone, weight) in influence.joints.iter().zip(influence.weights) {
                skin[*bone as usize * v + i] += weight;
            }
            // Weights descend, so the first bone is the strongest.
            strongest[influence.joints[0] as usize * v + i] = 1.0;
        }
        let total: f32 = fit_weight.iter().sum();
        let planar = |points: &[Vec3], rows: usize| {
            [0, 1, 2].map(|axis| tensor(points.iter().map(|p| p[axis]).collect(), [rows, v], &device))
        };
        Self {
            kind,
            parents: body.skeleton.parents.iter().map(|p| p.map(usize::from)).collect(),
            joints: shaped.joints.clone(),
            skin: tensor(skin, [j, v], &device),
            strongest: tensor(strongest, [j, v], &device),
            rest: planar(&rest, 1),
            correctives: planar(&body.pose_directions, 9 * (j - 1)),
            weights: tensor(fit_weight.iter().map(|w| w / total).collect(), [1, v], &device),
            pose_prior: None,
            smoothness: 0.0,
            device,
        }
    }

    /// The same with priors, m^2/rad^2: on each joint's squared turn from rest (`[J]`, the root's counting for nothing;
    /// none when empty) and on its squared turn since the frame before.
    pub fn with_priors(mut self, pose_prior: &[f64], smoothness: f64) -> Self {
        assert!(pose_prior.is_empty() || pose_prior.len() == self.joints.len(), "joints of a pose prior");
        let weight = |(j, w): (usize, &f64)| [if j == 0 { 0.0 } else { *w as f32 }; 3];
        let weights: Vec<f32> = pose_prior.iter().enumerate().flat_map(weight).collect();
        self.pose_prior = (!weights.is_empty()).then(|| tensor(weights, [1, 3 * self.joints.len()], &self.device));
        self.smoothness = smoothness;
        self
    }

    /// Objective of each frame, m^2: rotations `[B, J]`, translations `[B]`, scans `[B, V]`. The first frame has none
    /// before it.
    pub fn values(&self, rotations: &Frames, translations: &[Vec3], scans: &Frames) -> Vec<f64> {
        let poses = self.poses(rotations, translations, &self.device);
        let scans = self.planar_scans(scans);
        host(self.objective(&poses, None, &scans)).into_iter().map(f64::from).collect()
    }

    /// Fits all frames at once, whatever `config.batch` says, from the poses given. `before` holds the axis angles
    /// `[J]` of the frame before the first. Without smoothness Adam's steps do not mix frames, and this is the fit of
    /// each.
    pub fn fit(
        &self,
        config: &AdamFitConfig,
        before: Option<&[Vec3]>,
        rotations: &Frames,
        translations: &[Vec3],
        scans: &Frames,
        monitor: &dyn Monitor,
    ) -> Result<AdamFit> {
        if rotations.len() != scans.len() || translations.len() != scans.len() || scans.is_empty() {
            return Err(TrainError::Numeric(format!(
                "the pose fit got {} poses for {} scans: give one for each, and at least one",
                rotations.len(),
                scans.len()
            )));
        }
        let mut poses = self.poses(rotations, translations, &self.device.clone().autodiff());
        let scans = self.planar_scans(scans);
        let before = before.map(|turns| {
            let numbers = turns.iter().flat_map(|w| w.to_array()).collect();
            rotation_entries(tensor(numbers, [1, 3 * self.joints.len()], &self.device))
        });
        let mut adam = Adam::new(AdamConfig::default());
        let start = Instant::now();
        let (mut values, mut seconds) = (Vec::new(), Vec::new());
        monitor.begin("pose fit by Adam", config.iterations, "iterations");
        for iteration in 0..=config.iterations {
            let each = self.objective(&poses, before.as_ref(), &scans);
            values.push(host(each.clone()).into_iter().map(f64::from).collect());
            seconds.push(start.elapsed().as_secs_f64());
            if iteration == config.iterations || monitor.should_stop() {
                break;
            }
            let gradients = module_gradients(&poses, &mut each.sum().backward());
            let fallen = cosine(1.0, iteration, config.iterations, 0);
            let share = config.final_share + (1.0 - config.final_share) * fallen;
            poses = adam.step(poses, &gradients, config.learning_rate * share);
            monitor.advance(1, "");
        }
        monitor.end();
        let joints = self.joints.len();
        let vectors = |numbers: Vec<f32>| numbers.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)).collect();
        Ok(AdamFit {
            rotations: Frames::from_points(joints, vectors(host(poses.rotations.val()))),
            translations: vectors(host(poses.translations.val())),
            values,
            seconds,
        })
    }

    fn poses(&self, rotations: &Frames, translations: &[Vec3], device: &Device) -> Poses {
        let (b, j) = (translations.len(), self.joints.len());
        assert_eq!((rotations.len(), rotations.points_per_frame()), (b, j), "poses to fit");
        let translations = translations.iter().flat_map(|t| t.to_array()).collect();
        Poses {
            rotations: Param::from_tensor(tensor(rotations.to_numbers(), [b, 3 * j], device)),
            translations: Param::from_tensor(tensor(translations, [b, 3], device)),
        }
    }

    fn planar_scans(&self, scans: &Frames) -> [Tensor<2>; 3] {
        let (b, v) = (scans.len(), scans.points_per_frame());
        assert_eq!(v, self.weights.dims()[1], "vertices of a scan");
        let numbers = scans.to_numbers();
        [0, 1, 2].map(|axis| {
            let plane = numbers.iter().skip(axis).step_by(3).copied().collect();
            tensor(plane, [b, v], &self.device)
        })
    }

    /// `[B, 1]`.
    fn objective(&self, poses: &Poses, before: Option<&[Tensor<2>; 9]>, scans: &[Tensor<2>; 3]) -> Tensor<2> {
        let rotations = rotation_entries(poses.rotations.val());
        let features = self.features(&rotations);
        let rest = [0, 1, 2].map(|k| self.rest[k].clone() + features.clone().matmul(self.correctives[k].clone()));
        let bones = self.bone_transforms(&rotations, poses.translations.val());
        let blended = blend(&bones, &self.skin);
        let residual = match self.kind {
            ObjectiveKind::Posed => {
                let posed = |r: usize| {
                    let m = |c: usize| blended[3 * r + c].clone() * rest[c].clone();
                    m(0) + m(1) + m(2) + blended[9 + r].clone()
                };
                [0, 1, 2].map(|r| posed(r) - scans[r].clone())
            }
            ObjectiveKind::Unposed => {
                let unposed = self.unposed(&bones, blended, scans);
                let [x, y, z] = rest;
                let [ux, uy, uz] = unposed;
                [ux - x, uy - y, uz - z]
            }
        };
        let [x, y, z] = residual.map(|r| r.square());
        let mut value = ((x + y + z) * self.weights.clone()).sum_dim(1);
        if let Some(weights) = &self.pose_prior {
            value = value + (poses.rotations.val().square() * weights.clone()).sum_dim(1);
        }
        if self.smoothness > 0.0 {
            value = value + squared_turns(&rotations, before).sum_dim(1) * self.smoothness;
        }
        value
    }

    /// `R_j - I` of joints 1..J, row-major, `[B, 9 (J - 1)]`, from entries `[B, J]`.
    fn features(&self, entries: &[Tensor<2>; 9]) -> Tensor<2> {
        let [b, j] = entries[0].dims();
        let moved: Vec<Tensor<2>> = entries
            .iter()
            .enumerate()
            .map(|(i, e)| {
                let e = e.clone().slice([0..b, 1..j]);
                if i % 4 == 0 { e - 1.0 } else { e }
            })
            .collect();
        Tensor::<2>::stack::<3>(moved, 2).reshape([b, 9 * (j - 1)])
    }

    /// `posed_from_rest` of each bone, row-major rotation and then translation: `[12 B, J]`.
    fn bone_transforms(&self, entries: &[Tensor<2>; 9], translations: Tensor<2>) -> Tensor<2> {
        let [b, j] = entries[0].dims();
        let locals = Tensor::<2>::stack::<3>(entries.to_vec(), 2);
        let mut transforms: Vec<(Tensor<3>, Tensor<3>)> = Vec::with_capacity(j);
        for (bone, joint) in self.joints.iter().enumerate() {
            let local = locals.clone().slice([0..b, bone..bone + 1, 0..9]).reshape([b, 3, 3]);
            let centre = tensor(joint.to_array().to_vec(), [1, 3, 1], &self.device);
            let (rotation, above) = match self.parents[bone] {
                Some(parent) => {
                    let (rotation, offset) = transforms[parent].clone();
                    let carried = rotation.clone().matmul(centre.clone().expand([b, 3, 1])) + offset;
                    (rotation.matmul(local), carried)
                }
                None => (local, translations.clone().reshape([b, 3, 1]) + centre.clone()),
            };
            let offset = above - rotation.clone().matmul(centre.expand([b, 3, 1]));
            transforms.push((rotation, offset));
        }
        let rows = transforms
            .into_iter()
            .map(|(rotation, offset)| Tensor::cat(vec![rotation.reshape([b, 9]), offset.reshape([b, 3])], 1));
        let all = Tensor::<2>::stack::<3>(rows.collect(), 2);
        all.swap_dims(0, 1).reshape([12 * b, j])
    }

    /// Scans taken back to rest, `[B, V]` for each coordinate. A vertex whose blended matrix is near singular is
    /// taken back along its strongest bone, as the analytic fit does.
    fn unposed(&self, bones: &Tensor<2>, blended: Vec<Tensor<2>>, scans: &[Tensor<2>; 3]) -> [Tensor<2>; 3] {
        let folded = determinant(&blended).inner().lower_elem(SMALLEST_DETERMINANT);
        let blended = if folded.clone().any().into_scalar::<bool>() {
            let strongest = blend(bones, &self.strongest);
            blended.into_iter().zip(strongest).map(|(m, s)| m.mask_where(folded.clone(), s)).collect()
        } else {
            blended
        };
        let column = |c: usize| [0, 1, 2].map(|r| blended[3 * r + c].clone());
        let (c0, c1, c2) = (column(0), column(1), column(2));
        let moved = [0, 1, 2].map(|r| scans[r].clone() - blended[9 + r].clone());
        let normal = cross(&c1, &c2);
        let inverse = dot(&c0, &normal).recip();
        [dot(&moved, &normal), dot(&moved, &cross(&c2, &c0)), dot(&moved, &cross(&c0, &c1))]
            .map(|x| x * inverse.clone())
    }
}

/// Rodrigues' formula: the nine entries, row-major, `[B, J]` each, of axis angles `[B, 3 J]`.
fn rotation_entries(axis_angles: Tensor<2>) -> [Tensor<2>; 9] {
    let [b, width] = axis_angles.dims();
    let angles = axis_angles.reshape([b, width / 3, 3]);
    let part = |k: usize| angles.clone().slice([0..b, 0..width / 3, k..k + 1]).reshape([b, width / 3]);
    let (x, y, z) = (part(0), part(1), part(2));
    // The square root has no slope at zero; the shift changes an angle by less than rounding does.
    let square = x.clone().square() + y.clone().square() + z.clone().square() + 1e-12;
    let angle = square.clone().sqrt();
    let s = angle.clone().sin() / angle.clone();
    // (1 - cos a) / a^2 through the half angle, which keeps its digits near zero.
    let half = (angle * 0.5).sin();
    let c = half.square() * 2.0 / square;
    let product = |a: &Tensor<2>, b: &Tensor<2>| a.clone() * b.clone() * c.clone();
    let turn = |a: &Tensor<2>| a.clone() * s.clone();
    let diagonal = |a: &Tensor<2>, b: &Tensor<2>| (product(a, a) + product(b, b)).neg() + 1.0;
    [
        diagonal(&y, &z),
        product(&x, &y) - turn(&z),
        product(&x, &z) + turn(&y),
        product(&x, &y) + turn(&z),
        diagonal(&x, &z),
        product(&y, &z) - turn(&x),
        product(&x, &z) - turn(&y),
        product(&y, &z) + turn(&x),
        diagonal(&x, &y),
    ]
}

/// Squared angle, rad^2, between each frame's rotations and those of the frame before, `[B, J]`; the first frame's are
/// taken against `before` (`[1, J]` entries), or are zero.
fn squared_turns(entries: &[Tensor<2>; 9], before: Option<&[Tensor<2>; 9]>) -> Tensor<2> {
    let [b, j] = entries[0].dims();
    let mut sum = Tensor::zeros([b, j], &entries[0].device());
    for (i, now) in entries.iter().enumerate() {
        let first = before.map_or_else(|| now.clone().slice([0..1, 0..j]), |entries| entries[i].clone());
        let last = Tensor::cat(vec![first, now.clone().slice([0..b - 1, 0..j])], 0);
        sum = sum + (now.clone() - last).square();
    }
    // |R - R'|^2 = 8 sin^2(a / 2), and a^2 = 4 asin^2 as a series, which has a slope at zero; below a radian the rest
    // is under 1e-4 of it.
    let s = sum * 0.125;
    let series = [4.0 / 35.0, 8.0 / 45.0, 1.0 / 3.0, 1.0];
    series.iter().fold(s.clone() * (128.0 / 1575.0), |x, c| (x + *c) * s.clone()) * 4.0
}

/// Twelve entries of the blended transforms, `[B, V]` each, of bones `[12 B, J]` under weights `[J, V]`.
fn blend(bones: &Tensor<2>, weights: &Tensor<2>) -> Vec<Tensor<2>> {
    let all = bones.clone().matmul(weights.clone());
    let b = all.dims()[0] / 12;
    (0..12).map(|i| all.clone().slice_dim(0, i * b..(i + 1) * b)).collect()
}

fn determinant(blended: &[Tensor<2>]) -> Tensor<2> {
    let column = |c: usize| [0, 1, 2].map(|r| blended[3 * r + c].clone());
    dot(&column(0), &cross(&column(1), &column(2)))
}

fn dot(a: &[Tensor<2>; 3], b: &[Tensor<2>; 3]) -> Tensor<2> {
    let product = |k: usize| a[k].clone() * b[k].clone();
    product(0) + product(1) + product(2)
}

fn cross(a: &[Tensor<2>; 3], b: &[Tensor<2>; 3]) -> [Tensor<2>; 3] {
    let part = |i: usize, j: usize| a[i].clone() * b[j].clone() - a[j].clone() * b[i].clone();
    [part(1, 2), part(2, 0), part(0, 1)]
}
