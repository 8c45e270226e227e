//! Scan sets of the tube figure with known truth.

use crate::figure::{figure, jiggle, smooth_pose};
use glam::Vec3;
use softtissue_body::{BodyModel, Pose};
use softtissue_clips::{ClipEntry, ClipId, MotionClip, ScanClip, ScanSet, Split};
use softtissue_geometry::Frames;
use softtissue_random::Draws;
use std::path::Path;

pub const FPS: f32 = 60.0;

/// What the scans are made of.
#[derive(Clone)]
pub struct Recipe {
    pub frames: usize,
    pub pose_size: f32,
    /// Flesh, metres.
    pub flesh: f32,
    /// Static detail of the subject, metres.
    pub detail: f32,
    /// Scanner noise, metres a coordinate.
    pub noise: f32,
    /// Frames at the start in which the body stands still.
    pub still: usize,
}

pub const CLEAN: Recipe = Recipe { frames: 12, pose_size: 0.35, flesh: 0.0, detail: 0.0, noise: 0.0, still: 0 };

pub struct Truth {
    pub body: BodyModel,
    pub beta: Vec<f32>,
    pub detail: Vec<Vec3>,
}

impl Truth {
    pub fn new(recipe: &Recipe) -> Self {
        let body = figure(7, 8);
        let mut draws = Draws::new(21, "detail", 0, 0);
        let waves: Vec<[f32; 2]> =
            (0..6).map(|_| [draws.range(20.0, 35.0) as f32, draws.range(0.0, 6.0) as f32]).collect();
        let bump = |p: &Vec3| {
            let wave = |axis: usize, i: usize| (waves[i][0] * p[axis] + waves[i][1]).sin();
            recipe.detail * Vec3::new(wave(1, 0) * wave(2, 1), wave(0, 2) * wave(1, 3), wave(2, 4) * wave(0, 5))
        };
        let detail = body.template.iter().map(bump).collect();
        Self { body, beta: vec![0.8, -1.0, 0.5], detail }
    }

    pub fn motion(&self, id: &ClipId, recipe: &Recipe) -> MotionClip {
        let seed = id.stem().bytes().fold(7, |h, b| h * 31 % 100_003 + u64::from(b));
        let mut rotations = Frames::new(24);
        let mut translations = vec![];
        for t in 0..recipe.frames {
            let time = t.saturating_sub(recipe.still) as f32 / FPS;
            let (r, p) = smooth_pose(seed, time, recipe.pose_size);
            rotations.push(&r);
            translations.push(p);
        }
        MotionClip { id: id.clone(), fps: FPS, rotations, translations }
    }

    /// True deltas: flesh that stands still while the body does.
    pub fn deltas(&self, recipe: &Recipe) -> Frames {
        let mut deltas = Frames::new(self.body.vertex_count());
        for t in 0..recipe.frames {
            let time = t.saturating_sub(recipe.still) as f32 / FPS;
            let amplitude = if t < recipe.still { 0.0 } else { recipe.flesh };
            deltas.push(&jiggle(&self.body, time, amplitude));
        }
        deltas
    }

    pub fn scan(&self, id: &ClipId, recipe: &Recipe) -> ScanClip {
        let motion = self.motion(id, recipe);
        let mut deltas = self.deltas(recipe);
        for t in 0..recipe.frames {
            deltas.frame_mut(t).iter_mut().zip(&self.detail).for_each(|(x, d)| *x += *d);
        }
        let shaped = self.body.shaped(&self.beta);
        let mut vertices = self.body.posed_frames(&shaped, &motion.rotations, &motion.translations, Some(&deltas));
        let mut draws = Draws::new(3, &id.stem(), 0, 0);
        if recipe.noise > 0.0 {
            let mut number = || recipe.noise * draws.normal() as f32;
            vertices.points_mut().iter_mut().for_each(|p| *p += Vec3::new(number(), number(), number()));
        }
        ScanClip { id: id.clone(), fps: FPS, vertices }
    }

    pub fn write(&self, root: &Path, ids: &[ClipId], recipe: &Recipe) -> ScanSet {
        let mut entries = vec![];
        for id in ids {
            let scan = self.scan(id, recipe);
            scan.write(&ScanSet::scan_path(root, id)).unwrap();
            entries.push(ClipEntry { id: id.clone(), frames: scan.vertices.len(), fps: FPS });
        }
        let topology = self.body.topology.hash();
        ScanSet::finish(root, self.body.vertex_count(), &topology, serde_json::json!({}), entries).unwrap()
    }
}

/// Angle between the fitted and the true rotation of each joint, radians, and distance of joint positions, metres.
pub fn joint_errors(
    body: &BodyModel,
    beta: &[f32],
    fitted: &MotionClip,
    truth: &MotionClip,
    true_beta: &[f32],
) -> (Vec<f32>, Vec<f32>) {
    let (own, other) = (body.shaped(beta).joints, body.shaped(true_beta).joints);
    let (mut angles, mut distances) = (vec![], vec![]);
    for t in 0..truth.len() {
        let [a, b] = [fitted, truth].map(|m| Pose { rotations: m.rotations.frame(t), translation: m.translations[t] });
        for (x, y) in a.rotations.iter().zip(b.rotations) {
            angles.push(glam::Quat::from_scaled_axis(*x).angle_between(glam::Quat::from_scaled_axis(*y)));
        }
        let positions = body.posed_joints(&own, a).into_iter().zip(body.posed_joints(&other, b));
        distances.extend(positions.map(|(p, q)| p.distance(q)));
    }
    (angles, distances)
}

pub fn median(mut values: Vec<f32>) -> f32 {
    values.sort_by(f32::total_cmp);
    values[values.len() / 2]
}

pub fn all_train(ids: &[ClipId]) -> Split {
    Split { train: ids.to_vec(), validation: vec![], test: vec![] }
}

/// Mean distance of two sequences of fields over some vertices, metres.
pub fn mean_distance(a: &Frames, b: &Frames, vertices: &[u32]) -> f32 {
    let total: f32 = a
        .iter()
        .zip(b.iter())
        .flat_map(|(x, y)| vertices.iter().map(move |v| x[*v as usize].distance(y[*v as usize])))
        .sum();
    total / (a.len() * vertices.len()) as f32
}
