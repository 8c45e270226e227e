use super::{MeshFacts, Place, Problem, ProblemKind, SequenceWatch, WatchConfig, mesh_problems};
use glam::Vec3;
use softtissue_geometry::self_intersections;
use std::sync::Arc;

/// How a clip of points or meshes is examined.
#[derive(Clone, Copy, Debug)]
pub struct ExamConfig {
    /// What counts as wrong in the sequence.
    pub watch: WatchConfig,
    /// Frames, spread evenly, that are kept for pictures and tested for self-intersection. Default 6.
    pub sampled: usize,
    /// Surfaces that go less than this through each other touch, metres. Default 1e-3.
    pub tolerance_m: f32,
    /// Faces that may cut others before it is a problem, over the square root of the number of faces, since cuts run
    /// along lines: skin presses on skin at elbows, armpits and between the thighs. Default 10; heavy people whose arms
    /// hang make 6. A quarter of all faces is a problem in any case.
    pub contact: f32,
    /// Meshes with more faces are not tested for self-intersection. Default 500,000.
    pub most_faces: usize,
    /// Vertices and faces that are kept of all sampled frames together at most. Default 4 million.
    pub kept: usize,
}

impl Default for ExamConfig {
    fn default() -> Self {
        Self {
            watch: WatchConfig::default(),
            sampled: 6,
            tolerance_m: 1e-3,
            contact: 10.0,
            most_faces: 500_000,
            kept: 4_000_000,
        }
    }
}

impl ExamConfig {
    /// Faces of a mesh that may cut others.
    pub fn most_cut(&self, faces: usize) -> f32 {
        let faces = faces as f32;
        (self.contact * faces.sqrt()).min(0.25 * faces)
    }
}

/// A frame that is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Its number.
    pub frame: usize,
    /// Metres, Y up.
    pub points: Vec<Vec3>,
    /// Triangles; empty for points.
    pub faces: Arc<Vec<[u32; 3]>>,
}

/// What was found in a clip.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ClipFindings {
    /// Lowest and highest corner over all frames.
    pub range: Option<[Vec3; 2]>,
    /// The first frame's mesh.
    pub mesh: Option<MeshFacts>,
    /// Faces that cut through others, by sampled frame: (frame, faces).
    pub cut: Vec<(usize, usize)>,
    /// Some frames.
    pub samples: Vec<Sample>,
    /// What is wrong.
    pub problems: Vec<Problem>,
}

/// Examines a clip frame by frame.
pub struct ClipExam {
    config: ExamConfig,
    watch: SequenceWatch,
    /// Frames from which on one is sampled, ascending.
    wanted: Vec<usize>,
    faces: Arc<Vec<[u32; 3]>>,
    count: usize,
    room: usize,
    unreadable: Option<Problem>,
    topology: Option<Problem>,
    found: ClipFindings,
}

impl ClipExam {
    /// Of a clip of `frames` frames at `fps` a second.
    pub fn new(frames: usize, fps: f32, config: ExamConfig) -> Self {
        let n = config.sampled.clamp(1, frames.max(1));
        let mut wanted: Vec<usize> = (0..n).map(|i| i * frames.saturating_sub(1) / (n - 1).max(1)).collect();
        wanted.reverse();
        Self {
            config,
            watch: SequenceWatch::new(fps, config.watch),
            wanted,
            faces: Arc::default(),
            count: 0,
            room: config.kept,
            unreadable: None,
            topology: None,
            found: ClipFindings::default(),
        }
    }

    /// Triangles of all frames.
    pub fn faces(self, faces: Vec<[u32; 3]>) -> Self {
        Self { faces: Arc::new(faces), ..self }
    }

    /// The body that the clip is in the topology of: its triangles, and its vertices at rest.
    pub fn body(self, faces: Vec<[u32; 3]>, template: Vec<Vec3>) -> Self {
        let exam = self.faces(faces);
        Self { watch: exam.watch.template(template), ..exam }
    }

    /// A frame, in ascending order. Its own triangles must be those of the frames before.
    pub fn meshed_frame(&mut self, t: usize, points: &[Vec3], faces: Vec<[u32; 3]>) {
        if self.count == 0 {
            self.faces = Arc::new(faces);
        } else if *self.faces != faces {
            let says = "faces join other vertices than in the frame before";
            self.topology.get_or_insert_with(|| Problem::new(ProblemKind::TopologyChange, says)).add(Place::frame(t));
            self.faces = Arc::new(faces);
        }
        self.frame(t, points);
    }

    /// A frame, in ascending order, metres, Y up.
    pub fn frame(&mut self, t: usize, points: &[Vec3]) {
        self.watch.frame(t, points);
        let within = self.faces.iter().flatten().all(|i| (*i as usize) < points.len());
        if self.count == 0 && !self.faces.is_empty() {
            let (facts, problems) = mesh_problems(points, &self.faces);
            self.found.mesh = Some(facts);
            self.found.problems.extend(problems);
        }
        self.count += 1;
        if self.wanted.last().is_none_or(|w| t < *w) {
            return;
        }
        while self.wanted.last().is_some_and(|w| *w <= t) {
            self.wanted.pop();
        }
        if within && !self.faces.is_empty() && self.faces.len() <= self.config.most_faces {
            let cut = self_intersections(points, &self.faces, self.config.tolerance_m);
            self.found.cut.extend(cut.map(|cut| (t, cut.len())));
        }
        let size = points.len() + self.faces.len();
        if size <= self.room {
            self.room -= size;
            let faces = if within { self.faces.clone() } else { Arc::default() };
            self.found.samples.push(Sample { frame: t, points: points.to_vec(), faces });
        }
    }

    /// A frame that cannot be read.
    pub fn unreadable(&mut self, t: usize, says: &str) {
        self.unreadable.get_or_insert_with(|| Problem::new(ProblemKind::Unreadable, says)).add(Place::frame(t));
    }

    /// What was found.
    pub fn finish(self) -> ClipFindings {
        let mut found = self.found;
        found.range = self.watch.range();
        let sequence = self.watch.finish();
        // of two ways to see one change the count says more
        let topology = self.topology.filter(|_| sequence.iter().all(|p| p.kind != ProblemKind::TopologyChange));
        found.problems.extend(self.unreadable);
        found.problems.extend(topology);
        found.problems.extend(sequence);
        let faces = self.faces.len();
        if let Some((frame, cut)) = found.cut.iter().copied().max_by_key(|(t, cut)| (*cut, usize::MAX - t))
            && cut as f32 > self.config.most_cut(faces)
        {
            let share = 100.0 * cut as f32 / faces as f32;
            let says =
                format!("{cut} of {faces} faces ({share:.1} %) cut through others, more than skin contact makes");
            let mut problem = Problem::at(ProblemKind::SelfIntersection, says, [Place::frame(frame)]);
            problem.count = cut;
            found.problems.push(problem);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed tube of rings whose upper end is bent down by `bend` radians.
    fn tube(bend: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        const RINGS: u32 = 24;
        const ROUND: u32 = 10;
        let at = |r: u32, k: u32| {
            let a = k as f32 / ROUND as f32 * std::f32::consts::TAU;
            let height = r as f32 * 0.05;
            let local = Vec3::new(0.08 * a.cos(), height, -0.08 * a.sin());
            let turn = glam::Quat::from_rotation_z(bend * ((height - 0.4) / 0.2).clamp(0.0, 1.0));
            let pivot = Vec3::Y * 0.5;
            pivot + turn * (local - pivot) + Vec3::Y * 0.5
        };
        let mut points: Vec<Vec3> = (0..RINGS * ROUND).map(|i| at(i / ROUND, i % ROUND)).collect();
        let (low, high) = (points.len() as u32, points.len() as u32 + 1);
        points.extend([
            points[0].with_x(0.0),
            points[(RINGS as usize - 1) * ROUND as usize].lerp(points[low as usize - 5], 0.5),
        ]);
        let mut faces = Vec::new();
        for k in 0..ROUND {
            let l = (k + 1) % ROUND;
            faces.extend([[low, l, k], [high, (RINGS - 1) * ROUND + k, (RINGS - 1) * ROUND + l]]);
            for r in 0..RINGS - 1 {
                let (a, b) = (r * ROUND, (r + 1) * ROUND);
                faces.extend([[a + k, a + l, b + l], [a + k, b + l, b + k]]);
            }
        }
        (points, faces)
    }

    fn examined(bend: f32, change: impl Fn(usize, &mut Vec<[u32; 3]>)) -> ClipFindings {
        let mut exam = ClipExam::new(40, 60.0, ExamConfig::default());
        for t in 0..40 {
            let (mut points, mut faces) = tube(bend * t as f32 / 39.0);
            points.iter_mut().for_each(|p| p.x += 0.01 * t as f32);
            change(t, &mut faces);
            exam.meshed_frame(t, &points, faces);
        }
        exam.finish()
    }

    #[test]
    fn a_clean_clip_gives_no_finding_and_six_frames() {
        let found = examined(0.5, |_, _| ());
        assert_eq!(found.problems, []);
        assert_eq!(found.samples.iter().map(|s| s.frame).collect::<Vec<_>>(), [0, 7, 15, 23, 31, 39]);
        assert_eq!(found.cut, [0, 7, 15, 23, 31, 39].map(|t| (t, 0)));
        let mesh = found.mesh.expect("a mesh");
        assert_eq!((mesh.border_edges, mesh.genus), (0, Some(0)));
    }

    #[test]
    fn contact_is_a_fact_and_a_crumpled_surface_a_problem() {
        let folded = examined(3.0, |_, _| ());
        assert_eq!(folded.problems, []);
        assert!(folded.cut[5].1 > 10, "{:?}", folded.cut);
        let mut exam = ClipExam::new(40, 60.0, ExamConfig::default());
        for t in 0..40 {
            let (mut points, faces) = tube(0.1);
            points.iter_mut().enumerate().for_each(|(i, p)| p.x += 0.3 * (17.0 * i as f32).sin() * t as f32 / 39.0);
            exam.meshed_frame(t, &points, faces);
        }
        let found = exam.finish();
        let [problem] = &found.problems[..] else { panic!("{:?}", found.problems) };
        assert_eq!((problem.kind, problem.first[0].frame), (ProblemKind::SelfIntersection, Some(39)));
        assert!(problem.says.contains("%) cut"), "{}", problem.says);
    }

    #[test]
    fn faces_that_change_and_frames_that_cannot_be_read() {
        let found = examined(0.5, |t, faces| {
            if t == 11 {
                faces.swap(0, 1);
            }
        });
        assert_eq!(found.problems[0].kind, ProblemKind::TopologyChange);
        assert_eq!(found.problems[0].first.iter().filter_map(|p| p.frame).collect::<Vec<_>>(), [11, 12]);
        let flipped = examined(0.5, |_, faces| faces[7].swap(0, 1));
        assert_eq!((flipped.problems[0].kind, flipped.problems[0].count), (ProblemKind::FlippedFaces, 1));
        let mut exam = ClipExam::new(3, 60.0, ExamConfig::default());
        let (points, faces) = tube(0.0);
        exam.meshed_frame(0, &points, faces);
        exam.unreadable(1, "f1.obj: it holds no vertex");
        let found = exam.finish();
        assert_eq!((found.problems[0].kind, found.problems[0].count), (ProblemKind::Unreadable, 1));
    }
}
