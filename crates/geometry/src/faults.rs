use glam::Vec3;

/// Twice the area of a face over the square of its longest edge: a face below it is a line or a point.
const SLIVER: f32 = 1e-4;
/// The largest closed pieces among which a cavity's outer wall is looked for.
const WALLS: usize = 64;

/// What is wrong with a triangle mesh, and how it hangs together. Lists are ascending.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshFaults {
    /// Faces that name a vertex that is not there.
    pub stray: Vec<u32>,
    /// Faces that use a vertex twice or have no area.
    pub degenerate: Vec<u32>,
    /// Edges of more than two faces, smaller vertex first.
    pub non_manifold: Vec<[u32; 2]>,
    /// Faces wound against most of the piece that they are part of.
    pub flipped: Vec<u32>,
    /// Faces of closed pieces that enclose a negative volume, cavities within another piece left out.
    pub inside_out: Vec<u32>,
    /// Vertices that no face names.
    pub unused: Vec<u32>,
    /// Edges of one face.
    pub border_edges: usize,
    /// Parts that do not hang together by edges of two faces.
    pub pieces: usize,
    /// Holes through the solid, for one closed piece.
    pub genus: Option<i64>,
}

impl MeshFaults {
    /// Examines a mesh. Vertices that are not finite count as no degenerate face's.
    pub fn of(positions: &[Vec3], faces: &[[u32; 3]]) -> Self {
        let mut faults = Self::default();
        let sound = faults.faces_that_name_three_vertices(positions, faces);
        let graph = FaceGraph::new(faces, &sound);
        faults.non_manifold = graph.crowded.clone();
        faults.border_edges = graph.border_edges;
        faults.examine_pieces(positions, faces, &sound, &graph);
        faults.stray.sort_unstable();
        faults.degenerate.sort_unstable();
        faults
    }

    /// Whether the mesh is one closed, consistently wound, outward surface.
    pub fn is_sound(&self) -> bool {
        self.stray.is_empty()
            && self.degenerate.is_empty()
            && self.non_manifold.is_empty()
            && self.flipped.is_empty()
            && self.inside_out.is_empty()
            && self.border_edges == 0
    }

    /// `[F]` whether a face can be walked over; notes those that cannot, slivers, and unused vertices.
    fn faces_that_name_three_vertices(&mut self, positions: &[Vec3], faces: &[[u32; 3]]) -> Vec<bool> {
        let mut used = vec![false; positions.len()];
        let sound = faces
            .iter()
            .enumerate()
            .map(|(f, corners)| {
                let stray = corners.iter().any(|i| *i as usize >= positions.len());
                let [a, b, c] = *corners;
                let twice = a == b || b == c || c == a;
                if stray {
                    self.stray.push(f as u32);
                } else {
                    corners.iter().for_each(|i| used[*i as usize] = true);
                    if twice || is_sliver(corners.map(|i| positions[i as usize])) {
                        self.degenerate.push(f as u32);
                    }
                }
                !stray && !twice
            })
            .collect();
        self.unused = (0..positions.len() as u32).filter(|v| !used[*v as usize]).collect();
        sound
    }

    fn examine_pieces(&mut self, positions: &[Vec3], faces: &[[u32; 3]], sound: &[bool], graph: &FaceGraph) {
        let mut pieces: Vec<Piece> = Vec::new();
        let mut turned: Vec<Option<bool>> = vec![None; faces.len()];
        for start in 0..faces.len() {
            if sound[start] && turned[start].is_none() {
                let members = graph.walk(start, &mut turned);
                pieces.push(Piece::new(positions, faces, members, &turned, graph));
            }
        }
        self.pieces = pieces.len();
        self.flipped = pieces.iter().flat_map(|p| p.flipped.iter().copied()).collect();
        self.flipped.sort_unstable();
        let mut walls: Vec<&Piece> = pieces.iter().filter(|p| p.closed && p.volume > 0.0).collect();
        walls.sort_by(|a, b| b.volume.total_cmp(&a.volume));
        walls.truncate(WALLS);
        let is_cavity = |p: &Piece| walls.iter().any(|w| w.low.cmplt(p.low).all() && w.high.cmpgt(p.high).all());
        self.inside_out = pieces
            .iter()
            .filter(|p| p.closed && p.volume < 0.0 && !is_cavity(p))
            .flat_map(|p| p.members.iter().copied())
            .collect();
        self.inside_out.sort_unstable();
        if let [piece] = &pieces[..]
            && piece.closed
            && self.non_manifold.is_empty()
        {
            let vertices = (positions.len() - self.unused.len()) as i64;
            let n = piece.members.len() as i64;
            self.genus = Some((2 - (vertices - 3 * n / 2 + n)) / 2);
        }
    }
}

fn is_sliver([a, b, c]: [Vec3; 3]) -> bool {
    let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
    longest.is_finite() && (b - a).cross(c - a).length() <= SLIVER * longest
}

/// Which faces meet at which edges.
struct FaceGraph {
    /// `[F, 3]` the one other face at an edge, twice its number, plus one if it is wound the other way; or [`NONE`].
    links: Vec<[u32; 3]>,
    crowded: Vec<[u32; 2]>,
    border_edges: usize,
}

const NONE: u32 = u32::MAX;

impl FaceGraph {
    fn new(faces: &[[u32; 3]], sound: &[bool]) -> Self {
        // (edge, face * 3 + corner), the corner from which the edge goes out
        let mut edges: Vec<([u32; 2], u32)> = Vec::with_capacity(faces.len() * 3);
        for (f, corners) in faces.iter().enumerate().filter(|(f, _)| sound[*f]) {
            for k in 0..3 {
                let (a, b) = (corners[k], corners[(k + 1) % 3]);
                edges.push(([a.min(b), a.max(b)], (3 * f + k) as u32));
            }
        }
        edges.sort_unstable();
        let mut graph = Self { links: vec![[NONE; 3]; faces.len()], crowded: vec![], border_edges: 0 };
        let from = |side: u32| faces[side as usize / 3][side as usize % 3];
        for group in edges.chunk_by(|a, b| a.0 == b.0) {
            match *group {
                [_] => graph.border_edges += 1,
                [(_, a), (_, b)] => {
                    let against = u32::from(from(a) == from(b));
                    graph.links[a as usize / 3][a as usize % 3] = b / 3 * 2 + against;
                    graph.links[b as usize / 3][b as usize % 3] = a / 3 * 2 + against;
                }
                _ => graph.crowded.push(group[0].0),
            }
        }
        graph
    }

    /// All faces that are reached from `start`; sets whether each is turned against it.
    fn walk(&self, start: usize, turned: &mut [Option<bool>]) -> Vec<u32> {
        turned[start] = Some(false);
        let mut members = vec![start as u32];
        let mut at = 0;
        while at < members.len() {
            let face = members[at] as usize;
            at += 1;
            for link in self.links[face].into_iter().filter(|l| *l != NONE) {
                let other = (link / 2) as usize;
                if turned[other].is_none() {
                    turned[other] = turned[face].map(|t| t != (link % 2 == 1));
                    members.push(other as u32);
                }
            }
        }
        members
    }
}

/// Faces that hang together.
struct Piece {
    members: Vec<u32>,
    flipped: Vec<u32>,
    closed: bool,
    /// Enclosed volume with the winding of most faces.
    volume: f64,
    low: Vec3,
    high: Vec3,
}

impl Piece {
    fn new(
        positions: &[Vec3],
        faces: &[[u32; 3]],
        members: Vec<u32>,
        turned: &[Option<bool>],
        graph: &FaceGraph,
    ) -> Self {
        let is_turned = |f: &u32| turned[*f as usize] == Some(true);
        let against = members.iter().filter(|f| is_turned(f)).count();
        let mostly_turned = 2 * against > members.len();
        let flipped = members.iter().copied().filter(|f| is_turned(f) != mostly_turned).collect();
        let closed = members.iter().all(|f| graph.links[*f as usize].iter().all(|l| *l != NONE));
        let (mut low, mut high, mut volume) = (Vec3::INFINITY, Vec3::NEG_INFINITY, 0.0);
        for f in &members {
            let [a, b, c] = faces[*f as usize].map(|i| positions[i as usize]);
            (low, high) = (low.min(a).min(b).min(c), high.max(a).max(b).max(c));
            let [a, b, c] = [a, b, c].map(|p| p.as_dvec3());
            let cone = a.dot(b.cross(c)) / 6.0;
            volume += if is_turned(f) == mostly_turned { cone } else { -cone };
        }
        Self { members, flipped, closed, volume, low, high }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The corners and the twelve outward faces of a box.
    pub(crate) fn box_mesh(low: Vec3, high: Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let corner = |i: u32| Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), high, low);
        let quads = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let faces = quads.iter().flat_map(|q: &[u32; 4]| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        ((0..8).map(corner).collect(), faces)
    }

    fn add(to: &mut (Vec<Vec3>, Vec<[u32; 3]>), other: &(Vec<Vec3>, Vec<[u32; 3]>), inward: bool) {
        let base = to.0.len() as u32;
        to.0.extend(&other.0);
        to.1.extend(
            other.1.iter().map(|f| f.map(|i| i + base)).map(|[a, b, c]| if inward { [a, c, b] } else { [a, b, c] }),
        );
    }

    #[test]
    fn a_clean_box_has_no_fault() {
        let (p, f) = box_mesh(Vec3::ZERO, Vec3::ONE);
        let faults = MeshFaults::of(&p, &f);
        assert!(faults.is_sound());
        assert_eq!((faults.pieces, faults.genus, faults.unused.len()), (1, Some(0), 0));
    }

    #[test]
    fn planted_faults_are_found_where_they_are() {
        let (mut p, mut f) = box_mesh(Vec3::ZERO, Vec3::ONE);
        f[3].swap(1, 2);
        f[8].swap(1, 2);
        let faults = MeshFaults::of(&p, &f);
        assert_eq!((faults.flipped, faults.inside_out), (vec![3, 8], vec![]));
        f[3].swap(1, 2);
        f[8].swap(1, 2);
        // a fin on an edge of the box, whose outer vertex lies on the edge's line, and a vertex of nobody
        p.extend([Vec3::new(0.5, 0.0, 0.0), Vec3::splat(9.0)]);
        f.push([0, 1, 8]);
        f.push([0, 77, 1]);
        f.push([2, 2, 1]);
        let faults = MeshFaults::of(&p, &f);
        assert_eq!(faults.non_manifold, [[0, 1]]);
        assert_eq!((faults.degenerate, faults.stray, faults.unused), (vec![12, 14], vec![13], vec![9]));
    }

    #[test]
    fn a_box_turned_inside_out_is_told_from_a_cavity() {
        let mut mesh = box_mesh(Vec3::ZERO, Vec3::ONE);
        add(&mut mesh, &box_mesh(Vec3::splat(0.25), Vec3::splat(0.75)), true);
        let faults = MeshFaults::of(&mesh.0, &mesh.1);
        assert!(faults.is_sound() && faults.pieces == 2, "{faults:?}");
        add(&mut mesh, &box_mesh(Vec3::splat(2.0), Vec3::splat(3.0)), true);
        let faults = MeshFaults::of(&mesh.0, &mesh.1);
        assert_eq!(faults.inside_out, (24..36).collect::<Vec<u32>>());
        assert!(faults.flipped.is_empty());
    }

    #[test]
    fn an_open_mesh_has_a_border_and_no_inside() {
        let (p, f) = box_mesh(Vec3::ZERO, Vec3::ONE);
        let inward: Vec<[u32; 3]> = f[2..].iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let faults = MeshFaults::of(&p, &inward);
        assert_eq!((faults.border_edges, faults.inside_out.len(), faults.genus), (4, 0, None));
    }
}
