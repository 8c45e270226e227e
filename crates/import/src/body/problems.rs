use glam::Vec3;
use softtissue_body::BodyModel;
use softtissue_clips::inspection::{
    ExamConfig, MeshFacts, Place, Problem, ProblemKind, mesh_problems, misplaced_joints,
};
use softtissue_geometry::self_intersections;

/// A vertex whose partner in the mirror is farther off than this has the wrong one, metres.
const MIRROR_M: f32 = 0.03;

/// What is wrong with a body at rest, and how its mesh hangs together: winding, edges, self-intersection, joints on the
/// wrong side, a mirror that is none. Sums of skin weights are checked when a body is read.
pub fn examine_body(body: &BodyModel, config: &ExamConfig) -> (MeshFacts, Vec<Problem>) {
    let faces = &body.topology.faces;
    let (facts, mut problems) = mesh_problems(&body.template, faces);
    if facts.border_edges > 0 {
        let says = format!("{} edges have one face only: its volume and weight mean little", facts.border_edges);
        problems.push(Problem { count: facts.border_edges, ..Problem::new(ProblemKind::NotClosed, says) });
    }
    if faces.len() <= config.most_faces {
        let cut = self_intersections(&body.template, faces, config.tolerance_m).unwrap_or_default();
        if cut.len() as f32 > config.most_cut(faces.len()) {
            let says = format!("{} of {} faces cut through others at rest", cut.len(), faces.len());
            let places = cut.iter().map(|f| Place::face(*f));
            problems.push(Problem::at(ProblemKind::SelfIntersection, says, places));
        }
    }
    problems.extend(misplaced_joints(&body.skeleton.names, &body.shaped(&[]).joints));
    let (left, right) = body.template.iter().fold((f32::MIN, f32::MAX), |(l, r), p| (l.max(p.x), r.min(p.x)));
    let partner = |v: usize| body.template[body.mirror.vertices[v] as usize];
    let flipped = |p: Vec3| Vec3::new(left + right - p.x, p.y, p.z);
    let strays = (0..body.vertex_count()).filter(|v| partner(*v).distance(flipped(body.template[*v])) > MIRROR_M);
    let places: Vec<Place> = strays.map(|v| Place::vertex(v as u32)).collect();
    if !places.is_empty() {
        let says = format!("{} vertices lie far from where their partner on the other side is", places.len());
        problems.push(Problem::at(ProblemKind::LeftRightSwap, says, places));
    }
    (facts, problems)
}
