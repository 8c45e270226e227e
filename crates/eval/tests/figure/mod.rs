//! A toy for tests and for the sample report: a pear-shaped figure with three joints, and flesh that is a damped
//! oscillator a region, driven by the root's acceleration.

use glam::{Vec2, Vec3};
use softtissue_body::{BodyModel, JointRegressor, Mirror, Region, RegionMap, Skeleton, SkinWeights, UvAtlas};
use softtissue_clips::{
    ClipEntry, ClipId, DeltaClip, FitSet, FittedSubject, MotionClip, ScanClip, ScanSet, TrueSubject, TruthSet,
};
use softtissue_eval::{Method, MethodError, Scene};
use softtissue_geometry::{Frames, Topology};
use softtissue_random::Draws;
use std::f32::consts::TAU;
use std::path::Path;
use std::sync::Arc;

/// Frames a second of every clip.
pub const FPS: f32 = 60.0;

/// A surface of revolution of `rows * columns + 2` vertices, 1.6 m high.
pub fn body(rows: usize, columns: usize) -> BodyModel {
    let mut template = vec![Vec3::ZERO];
    let radius = |y: f32| {
        let bump = |centre: f32, width: f32| (-((y - centre) / width).powi(2)).exp();
        0.05 + 0.14 * bump(0.25, 0.25) + 0.16 * bump(0.75, 0.25) + 0.10 * bump(1.15, 0.15) + 0.09 * bump(1.45, 0.1)
    };
    let mut regions = vec![Region::Feet];
    for r in 0..rows {
        let y = 1.6 * (r as f32 + 0.5) / rows as f32;
        let cap = (y / 0.08).min((1.6 - y) / 0.08).clamp(0.2, 1.0).sqrt();
        for c in 0..columns {
            let angle = TAU * c as f32 / columns as f32;
            let (side, front) = angle.sin_cos();
            template.push(Vec3::new(side * radius(y) * cap, y, front * radius(y) * cap));
            regions.push(match y {
                y if y < 0.15 => Region::Feet,
                y if y < 0.45 => Region::Thighs,
                y if y < 0.65 && front < 0.0 => Region::Buttocks,
                y if y < 0.95 && front > -0.2 => Region::Belly,
                y if (1.0..1.25).contains(&y) && front > 0.0 => Region::Chest,
                y if (1.0..1.25).contains(&y) && side.abs() > 0.8 => Region::UpperArms,
                y if y > 1.3 => Region::Head,
                _ => Region::Rest,
            });
        }
    }
    template.push(Vec3::new(0.0, 1.6, 0.0));
    regions.push(Region::Head);
    let top = (rows * columns + 1) as u32;
    let at = |r: usize, c: usize| (1 + r * columns + c % columns) as u32;
    let mut faces = Vec::new();
    for c in 0..columns {
        faces.push([0, at(0, c + 1), at(0, c)]);
        faces.push([top, at(rows - 1, c), at(rows - 1, c + 1)]);
        for r in 0..rows - 1 {
            faces.push([at(r, c), at(r, c + 1), at(r + 1, c + 1)]);
            faces.push([at(r, c), at(r + 1, c + 1), at(r + 1, c)]);
        }
    }
    let v = template.len();
    BodyModel {
        shape_directions: template.iter().map(|p| Vec3::new(p.x, 0.0, p.z) * -0.1).collect(),
        pose_directions: vec![Vec3::ZERO; 9 * 2 * v],
        joint_regressor: JointRegressor { rows: [0.3, 0.9, 1.3].map(|h| ring(&template, h, columns)).to_vec() },
        skin: template.iter().map(|p| skin(p.y)).collect(),
        skeleton: Skeleton {
            names: ["pelvis", "spine", "head"].map(str::to_owned).to_vec(),
            parents: vec![None, Some(0), Some(1)],
        },
        uv: UvAtlas { coordinates: vec![Vec2::ZERO], faces: vec![[0; 3]; faces.len()] },
        mirror: Mirror { vertices: (0..v as u32).collect(), joints: vec![0, 1, 2] },
        regions: RegionMap(regions),
        topology: Arc::new(Topology { vertex_count: v, faces, quads: vec![] }),
        template,
    }
}

fn ring(template: &[Vec3], height: f32, columns: usize) -> Vec<(u32, f32)> {
    let mut rows: Vec<(u32, f32)> =
        template.iter().enumerate().map(|(i, p)| (i as u32, (p.y - height).abs())).collect();
    rows.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    rows.truncate(columns);
    rows.into_iter().map(|(i, _)| (i, 1.0 / columns as f32)).collect()
}

fn skin(y: f32) -> SkinWeights {
    let step = |x: f32| (x / 0.4 + 0.5).clamp(0.0, 1.0);
    let (spine, head) = (step(y - 0.9), step(y - 1.3));
    let mut pairs = [(0u8, 1.0 - spine), (1, spine * (1.0 - head)), (2, spine * head)];
    pairs.sort_by(|a, b| b.1.total_cmp(&a.1));
    SkinWeights { joints: [pairs[0].0, pairs[1].0, pairs[2].0, 0], weights: [pairs[0].1, pairs[1].1, pairs[2].1, 0.0] }
}

/// The figure hops at `hz` and bends, then stands still from `stop_frame` on.
pub fn motion(subject: &str, name: &str, hz: f32, frames: usize, stop_frame: usize) -> MotionClip {
    let mut rotations = Frames::new(3);
    let mut translations = Vec::new();
    for t in 0..frames {
        let time = t.min(stop_frame) as f32 / FPS;
        let (sin, cos) = (TAU * hz * time).sin_cos();
        let start = (time / 0.5).min(1.0);
        rotations.push(&[
            Vec3::Y * 0.5 * start * (TAU * 0.4 * time).sin(),
            Vec3::new(0.25 * start * (1.0 - cos), 0.0, 0.15 * sin * start),
            Vec3::X * -0.2 * start * (1.0 - cos),
        ]);
        translations.push(Vec3::new(0.02 * sin, 0.05 * (sin.abs() * 1.5).sin().abs(), 0.0) * start);
    }
    MotionClip { id: ClipId::new(subject, name, 0), fps: FPS, rotations, translations }
}

/// Flesh as one damped oscillator a region: truth and methods alike, with other numbers.
pub struct Oscillator {
    pub name: &'static str,
    /// Belly's frequency, hertz; the other regions' are multiples of it.
    pub hz: f32,
    /// Damping ratio.
    pub damping_ratio: f32,
    /// Scale of the output.
    pub gain: f32,
}

impl Oscillator {
    fn tone(region: Region) -> Option<(f32, f32)> {
        Some(match region {
            Region::Belly => (1.0, 1.0),
            Region::Chest => (1.2, 0.8),
            Region::Buttocks => (1.1, 0.7),
            Region::Thighs => (1.5, 0.8),
            Region::UpperArms => (1.8, 0.8),
            _ => return None,
        })
    }
    /// Displacement of each region's flesh, `[T]`.
    fn response(&self, motion: &MotionClip, region: Region) -> Vec<Vec3> {
        let Some((pitch, amount)) = Self::tone(region) else { return vec![Vec3::ZERO; motion.len()] };
        let (w, mut x, mut v) = (TAU * self.hz * pitch, Vec3::ZERO, Vec3::ZERO);
        let substeps = 16;
        let dt = 1.0 / FPS / substeps as f32;
        let root = |t: usize| motion.translations[t];
        (0..motion.len())
            .map(|t| {
                if t >= 2 {
                    let a = (root(t) - 2.0 * root(t - 1) + root(t - 2)) * FPS * FPS;
                    for _ in 0..substeps {
                        v += (-a * amount - x * w * w - v * 2.0 * self.damping_ratio * w) * dt;
                        x += v * dt;
                    }
                }
                x * self.gain
            })
            .collect()
    }
    /// Deltas `[T, V, 3]` on a body.
    pub fn deltas(&self, body: &BodyModel, motion: &MotionClip) -> Frames {
        let responses: Vec<Vec<Vec3>> = Region::ALL.iter().map(|r| self.response(motion, *r)).collect();
        let mut frames = Frames::new(body.vertex_count());
        for t in 0..motion.len() {
            let frame: Vec<Vec3> = body
                .regions
                .0
                .iter()
                .zip(&body.template)
                .map(|(r, p)| responses[*r as usize][t] * (0.7 + 0.3 * (p.x * 40.0).cos()))
                .collect();
            frames.push(&frame);
        }
        frames
    }
}

/// An oscillator on a body: a method.
pub struct OnBody<'a>(pub &'a BodyModel, pub Oscillator);

impl Method for OnBody<'_> {
    fn name(&self) -> &str {
        self.1.name
    }
    fn rollout(&self, _: &str, _: &[f32], motion: &MotionClip) -> Result<Frames, MethodError> {
        Ok(self.1.deltas(self.0, motion))
    }
}

/// The flesh of the toy.
pub fn truth() -> Oscillator {
    Oscillator { name: "truth", hz: 3.0, damping_ratio: 0.15, gain: 1.0 }
}

/// Everything that evaluation reads, on disk.
pub struct World {
    pub body: BodyModel,
    pub scans: ScanSet,
    pub fit: FitSet,
    pub truth: TruthSet,
    pub clips: Vec<ClipId>,
}

impl World {
    /// Makes scans, a fit and truth under `root`: the scan deltas are the true ones with 1 mm of noise, the fitted and
    /// rough poses are off by 0.2 and 2 degrees.
    pub fn make(root: &Path, body: BodyModel, motions: &[MotionClip]) -> Self {
        let (scan_root, fit_root, truth_root) = (root.join("scans"), root.join("fit"), root.join("truth"));
        let mut entries = Vec::new();
        let mut subjects = Vec::new();
        for m in motions {
            let mut draws = Draws::new(1, &m.id.to_string(), 0, 0);
            let deltas = truth().deltas(&body, m);
            let mut noisy = deltas.clone();
            let mut noise = |scale: f32| Vec3::from_array(std::array::from_fn(|_| draws.normal() as f32 * scale));
            noisy.points_mut().iter_mut().for_each(|p| *p += noise(0.001 / 1.596));
            let off = |degrees: f32| {
                let mut off = m.clone();
                off.rotations.points_mut().iter_mut().for_each(|w| *w += Vec3::X * degrees.to_radians());
                off
            };
            let (id, fps) = (m.id.clone(), m.fps);
            let clean = posed(&body, m, &deltas);
            ScanClip { id: id.clone(), fps, vertices: posed(&body, m, &noisy) }
                .write(&ScanSet::scan_path(&scan_root, &id))
                .unwrap();
            ScanClip { id: id.clone(), fps, vertices: clean }.write(&TruthSet::clean_path(&truth_root, &id)).unwrap();
            off(2.0).write(&ScanSet::rough_path(&scan_root, &id)).unwrap();
            off(0.2).write(&FitSet::motion_path(&fit_root, &id)).unwrap();
            m.write(&TruthSet::motion_path(&truth_root, &id)).unwrap();
            DeltaClip { id: id.clone(), fps, deltas }.write(&TruthSet::delta_path(&truth_root, &id)).unwrap();
            DeltaClip { id: id.clone(), fps, deltas: noisy }.write(&FitSet::delta_path(&fit_root, &id)).unwrap();
            entries.push(ClipEntry { id, frames: m.len(), fps });
            if !subjects.contains(&m.id.subject) {
                subjects.push(m.id.subject.clone());
            }
        }
        let (v, topology) = (body.vertex_count(), body.topology.hash());
        for subject in &subjects {
            let fitted = FittedSubject {
                subject: subject.clone(),
                beta: vec![0.5],
                template: vec![Vec3::ZERO; v],
                fit_weight: vec![1.0; v],
                rigidity_weight: vec![1.0; v],
            };
            fitted.write(&FitSet::subject_path(&fit_root, subject)).unwrap();
        }
        let note = serde_json::json!({ "toy": true });
        let known = |s: &String| TrueSubject { subject: s.clone(), beta: vec![0.5], bmi: 24.0, notes: note.clone() };
        let mut clips: Vec<ClipId> = motions.iter().map(|m| m.id.clone()).collect();
        clips.sort();
        Self {
            scans: ScanSet::finish(&scan_root, v, &topology, note.clone(), entries.clone()).unwrap(),
            fit: FitSet::finish(&fit_root, v, &topology, note.clone(), entries).unwrap(),
            truth: TruthSet::finish(&truth_root, subjects.iter().map(known).collect()).unwrap(),
            body,
            clips,
        }
    }
    /// The scene with truth.
    pub fn scene(&self) -> Scene<'_> {
        Scene { body: &self.body, fit: &self.fit, scans: Some(&self.scans), truth: Some(&self.truth) }
    }
}

fn posed(body: &BodyModel, motion: &MotionClip, deltas: &Frames) -> Frames {
    let shaped = body.shaped(&[0.5]);
    let mut frames = Frames::new(body.vertex_count());
    for t in 0..motion.len() {
        let pose = softtissue_body::Pose { rotations: motion.rotations.frame(t), translation: motion.translations[t] };
        frames.push(&body.posed(&shaped, pose, Some(deltas.frame(t))));
    }
    frames
}
