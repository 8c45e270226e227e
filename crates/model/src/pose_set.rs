use crate::{FrameSource, ModelError, Pca, PcaConfig, coefficients_of};
use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};
use softtissue_body::{BodyModel, Skeleton};
use softtissue_bundle::DeltaBasis;
use softtissue_bundle::descriptor::pose_numbers;
use softtissue_geometry::{Frames, axis_angle_from_rotation, rotation_from_axis_angle};
use softtissue_monitor::Monitor;
use softtissue_random::Draws;

/// How the set of poses is made that the pose autoencoder learns from. The paper takes 76,094 poses of motion capture;
/// here a training set makes its own from the poses there are, so that no pose of a clip that is left out can enter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PoseSetConfig {
    /// Whether the mirror image of every pose is added. Default true.
    pub mirror: bool,
    /// Poses put together from the trunk, head, arms and legs of different ones, as a multiple of those there are. Default
    /// 1: left-out motions are fitted better by a fifth than with none; more gains little.
    pub recombined: f64,
    /// Standard deviation of the turn that each neck, head, wrist and hand of a recombined pose gets about each axis,
    /// radians. Default 0.25: habits of more people than there are.
    pub habit: f64,
    /// Principal components of the posed vertices of the mean shape that stand for the mesh. Default 64.
    pub components: usize,
}

impl Default for PoseSetConfig {
    fn default() -> Self {
        Self { mirror: true, recombined: 1.0, habit: 0.25, components: 64 }
    }
}

/// Poses `[N, J]` with the root's orientation left out.
#[derive(Clone, Debug)]
pub struct PoseSet {
    rotations: Frames,
}

/// Poses as the pose autoencoder sees them.
#[derive(Clone, Debug, Default)]
pub struct PoseFrames {
    /// Joint angles, `[N, 3 (J - 1)]`, radians: see [`PoseEncoder`](softtissue_bundle::descriptor::PoseEncoder).
    pub angles: Vec<f32>,
    /// Coefficients of the posed mean shape, `[N, K]`, metres.
    pub coefficients: Vec<f32>,
    /// Poses `N`.
    pub count: usize,
}

/// Poses posed at a time.
const CHUNK: usize = 512;
/// Most poses that the principal components are found from, evenly spread.
const MOST_FOR_COMPONENTS: usize = 4096;

impl PoseSet {
    /// Poses of motions `[T, J]`: fitted ones of the training clips, and any others there are. Recombined poses follow the
    /// draws alone.
    pub fn new(config: &PoseSetConfig, body: &BodyModel, motions: &[Frames], draws: &mut Draws) -> Self {
        let mut rotations = Frames::new(body.joint_count());
        let mut add = |pose: &[Vec3]| {
            let mut pose = pose.to_vec();
            pose[0] = Vec3::ZERO;
            rotations.push(&pose);
        };
        for motion in motions {
            motion.iter().for_each(&mut add);
            if config.mirror {
                motion.iter().for_each(|pose| add(&body.mirror.rotations(pose)));
            }
        }
        let own = rotations.len();
        let groups = groups(&body.skeleton);
        let loose = loose(&body.skeleton);
        for _ in 0..(own as f64 * config.recombined).round() as usize {
            let pose = recombined(&rotations, own, &groups, &loose, config.habit, draws);
            rotations.push(&pose);
        }
        Self { rotations }
    }

    /// The poses of motions as they are: no mirror image, nothing recombined.
    pub fn plain(body: &BodyModel, motions: &[Frames]) -> Self {
        let config = PoseSetConfig { mirror: false, recombined: 0.0, ..PoseSetConfig::default() };
        Self::new(&config, body, motions, &mut Draws::new(0, "no draw is taken", 0, 0))
    }

    /// Poses, `[N, J]`.
    pub fn rotations(&self) -> &Frames {
        &self.rotations
    }

    /// Principal components of the posed vertices of the mean shape, `[K, 3 V]`.
    pub fn components(
        &self,
        body: &BodyModel,
        config: &PoseSetConfig,
        draws: &mut Draws,
        monitor: &dyn Monitor,
    ) -> Result<DeltaBasis, ModelError> {
        let stride = self.rotations.len().div_ceil(MOST_FOR_COMPONENTS).max(1);
        let mut chosen = Frames::new(body.joint_count());
        self.rotations.iter().step_by(stride).for_each(|pose| chosen.push(pose));
        let pca = PcaConfig { components: config.components, ..PcaConfig::default() };
        Ok(Pca::fit(&Posed { body, rotations: &chosen }, &pca, draws, monitor)?.basis)
    }

    /// Joint angles and coefficients of every pose.
    pub fn frames(
        &self,
        body: &BodyModel,
        basis: &DeltaBasis,
        monitor: &dyn Monitor,
    ) -> Result<PoseFrames, ModelError> {
        let source = Posed { body, rotations: &self.rotations };
        let mut coefficients = Vec::with_capacity(self.rotations.len() * basis.directions.rows());
        for i in 0..source.chunk_count() {
            if monitor.should_stop() {
                return Err(ModelError::Stopped);
            }
            coefficients.extend(coefficients_of(basis, &source.posed(i)));
        }
        let angles = self.rotations.iter().flat_map(pose_numbers).collect();
        Ok(PoseFrames { angles, coefficients, count: self.rotations.len() })
    }
}

/// Posed vertices of the mean shape.
struct Posed<'a> {
    body: &'a BodyModel,
    rotations: &'a Frames,
}

impl Posed<'_> {
    fn posed(&self, i: usize) -> Frames {
        let part = self.rotations.slice(i * CHUNK..((i + 1) * CHUNK).min(self.rotations.len()));
        let translations = vec![Vec3::ZERO; part.len()];
        self.body.posed_frames(&self.body.shaped(&[]), &part, &translations, None)
    }
}

impl FrameSource for Posed<'_> {
    fn width(&self) -> usize {
        3 * self.body.vertex_count()
    }
    fn chunk_count(&self) -> usize {
        self.rotations.len().div_ceil(CHUNK)
    }
    fn chunk(&self, i: usize) -> Result<Vec<f32>, ModelError> {
        Ok(self.posed(i).to_numbers())
    }
}

/// `[J]` which part of the body a joint belongs to: the trunk (0), or what hangs on it, by its uppermost joint.
fn groups(skeleton: &Skeleton) -> Vec<usize> {
    let trunk = skeleton.trunk();
    let mut groups = vec![0; skeleton.len()];
    for j in 1..skeleton.len() {
        let parent = skeleton.parents[j].map_or(0, usize::from);
        groups[j] = match (trunk[j], trunk[parent]) {
            (true, _) => 0,
            (false, true) => j,
            (false, false) => groups[parent],
        };
    }
    groups
}

/// Joints whose turn is a person's habit and moves few vertices.
fn loose(skeleton: &Skeleton) -> Vec<usize> {
    let is_loose = |name: &String| ["neck", "head", "wrist", "hand"].iter().any(|part| name.contains(part));
    (1..skeleton.len()).filter(|j| is_loose(&skeleton.names[*j])).collect()
}

/// A pose whose every part is another's, among the first `own`.
fn recombined(
    rotations: &Frames,
    own: usize,
    groups: &[usize],
    loose: &[usize],
    habit: f64,
    draws: &mut Draws,
) -> Vec<Vec3> {
    let mut pose = vec![Vec3::ZERO; groups.len()];
    for group in (0..groups.len()).filter(|g| *g == 0 || groups[*g] == *g) {
        let from = rotations.frame(draws.below(own));
        (0..groups.len()).filter(|j| groups[*j] == group).for_each(|j| pose[j] = from[j]);
    }
    for &j in loose {
        let turn = Vec3::from_array(std::array::from_fn(|_| (habit * draws.normal()) as f32));
        let turned: Mat3 = rotation_from_axis_angle(pose[j]) * rotation_from_axis_angle(turn);
        pose[j] = axis_angle_from_rotation(turned);
    }
    pose
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_the_body_are_the_trunk_and_what_hangs_on_it() {
        let skeleton = Skeleton::smpl();
        let groups = groups(&skeleton);
        let of = |name: &str| groups[skeleton.index(name).unwrap()];
        assert_eq!([of("spine2"), of("left_collar"), of("neck")], [0; 3]);
        assert_eq!(of("left_hand"), of("left_shoulder"));
        assert_eq!(of("right_foot"), of("right_hip"));
        let mut parts = groups.clone();
        parts.sort_unstable();
        parts.dedup();
        assert_eq!(parts.len(), 6);
        assert_eq!(loose(&skeleton).len(), 6);
    }

    #[test]
    fn a_recombined_pose_takes_each_part_whole_from_one_pose() {
        let skeleton = Skeleton::smpl();
        let mut rotations = Frames::new(24);
        // the pose's number stands in every joint
        (0..50).for_each(|n| rotations.push(&[Vec3::new(0.01 * n as f32, 0.0, 0.0); 24]));
        let (groups, loose) = (groups(&skeleton), loose(&skeleton));
        let mut draws = Draws::new(1, "poses", 0, 0);
        let mut mixed = 0;
        for _ in 0..40 {
            let pose = recombined(&rotations, 20, &groups, &loose, 0.3, &mut draws);
            let source = |j: usize| (pose[j].x * 100.0).round() as usize;
            for j in (0..24).filter(|j| !loose.contains(j)) {
                let first = (0..24).find(|k| groups[*k] == groups[j]).unwrap();
                assert!(pose[j].y == 0.0 && pose[j].z == 0.0 && source(j) == source(first) && source(j) < 20);
            }
            mixed += usize::from(source(1) != source(2) && source(16) != source(3));
            let wrist = skeleton.index("left_wrist").unwrap();
            assert!(pose[wrist].y != 0.0);
        }
        assert!(mixed > 30, "{mixed} of 40 poses are mixed");
    }
}
