use super::{Place, Problem, ProblemKind};
use glam::Vec3;
use serde::Serialize;
use softtissue_geometry::MeshFaults;

/// How a mesh hangs together.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MeshFacts {
    /// Triangles.
    pub triangles: usize,
    /// Parts that do not hang together.
    pub pieces: usize,
    /// Edges of one triangle; 0 for a closed mesh.
    pub border_edges: usize,
    /// Vertices that no triangle names.
    pub unused_vertices: usize,
    /// Holes through the solid, for one closed piece.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub genus: Option<i64>,
}

/// How a mesh hangs together and what is wrong with it, self-intersection left out.
pub fn mesh_problems(positions: &[Vec3], faces: &[[u32; 3]]) -> (MeshFacts, Vec<Problem>) {
    let faults = MeshFaults::of(positions, faces);
    let of_faces = |kind, says: &str, faces: &[u32]| {
        (!faces.is_empty())
            .then(|| Problem::at(kind, format!("{} {says}", faces.len()), faces.iter().map(|f| Place::face(*f))))
    };
    let edges = faults.non_manifold.iter().map(|e| Place::edge(*e));
    let problems = [
        of_faces(ProblemKind::StrayFaces, "faces name vertices that are not there", &faults.stray),
        of_faces(ProblemKind::DegenerateFaces, "faces have no area", &faults.degenerate),
        of_faces(ProblemKind::FlippedFaces, "faces are wound against their neighbours", &faults.flipped),
        of_faces(ProblemKind::InsideOut, "faces of closed surfaces look inwards", &faults.inside_out),
        (!faults.non_manifold.is_empty()).then(|| {
            let says = format!("{} edges have more than two faces", faults.non_manifold.len());
            Problem::at(ProblemKind::NonManifoldEdges, says, edges)
        }),
    ];
    let facts = MeshFacts {
        triangles: faces.len(),
        pieces: faults.pieces,
        border_edges: faults.border_edges,
        unused_vertices: faults.unused.len(),
        genus: faults.genus,
    };
    (facts, problems.into_iter().flatten().collect())
}
