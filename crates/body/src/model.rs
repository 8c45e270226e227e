use crate::RegionMap;
use glam::{Vec2, Vec3};
use softtissue_geometry::Topology;
use std::sync::Arc;

/// Everything that defines a parametric body. Counts are run-time numbers:
/// `V` vertices, `J` joints, `S` shape coefficients, `P = 9 (J - 1)` pose features.
#[derive(Clone, Debug)]
pub struct BodyModel {
    /// Connectivity, closed and outward.
    pub topology: Arc<Topology>,
    /// Mean rest shape `T`, `[V]`.
    pub template: Vec<Vec3>,
    /// Shape blendshapes, `[S, V]`: displacement for one unit of each `beta`.
    pub shape_directions: Vec<Vec3>,
    /// Pose blendshapes, `[P, V]`: displacement for one unit of each entry of `R_j - I`, joints 1..J in order,
    /// row-major within a joint.
    pub pose_directions: Vec<Vec3>,
    /// Joints from the shaped rest mesh.
    pub joint_regressor: JointRegressor,
    /// Skin weights, `[V]`.
    pub skin: Vec<SkinWeights>,
    /// Joint names and parents.
    pub skeleton: Skeleton,
    /// Texture coordinates.
    pub uv: UvAtlas,
    /// Left-right symmetry.
    pub mirror: Mirror,
    /// Named regions.
    pub regions: RegionMap,
}

/// Sparse rows: joint `j` is the sum of `weight * rest_vertex` over its row.
#[derive(Clone, Debug, PartialEq)]
pub struct JointRegressor {
    /// `[J]` rows of (vertex, weight).
    pub rows: Vec<Vec<(u32, f32)>>,
}

/// At most four joints move a vertex; weights are non-negative, descending, and sum to one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinWeights {
    /// Joint indices (unused slots: 0 with weight 0).
    pub joints: [u8; 4],
    /// Weights.
    pub weights: [f32; 4],
}

/// The kinematic tree; parents come before children, joint 0 is the root.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Skeleton {
    /// `[J]` names.
    pub names: Vec<String>,
    /// `[J]` parents, `None` for the root.
    pub parents: Vec<Option<u8>>,
}

/// Texture coordinates with their own triangles, so that seams need no doubled vertices.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct UvAtlas {
    /// Coordinates in `[0, 1]^2`.
    pub coordinates: Vec<Vec2>,
    /// `[F, 3]` into `coordinates`, corner for corner with the mesh's faces.
    pub faces: Vec<[u32; 3]>,
}

/// Left-right symmetry under `x -> -x`; both maps are involutions.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mirror {
    /// `[V]` the vertex on the other side.
    pub vertices: Vec<u32>,
    /// `[J]` the joint on the other side.
    pub joints: Vec<u8>,
}

impl Skeleton {
    /// SMPL's 24 joints in SMPL's order.
    pub fn smpl() -> Self {
        const JOINTS: [(&str, i8); 24] = [
            ("pelvis", -1),
            ("left_hip", 0),
            ("right_hip", 0),
            ("spine1", 0),
            ("left_knee", 1),
            ("right_knee", 2),
            ("spine2", 3),
            ("left_ankle", 4),
            ("right_ankle", 5),
            ("spine3", 6),
            ("left_foot", 7),
            ("right_foot", 8),
            ("neck", 9),
            ("left_collar", 9),
            ("right_collar", 9),
            ("head", 12),
            ("left_shoulder", 13),
            ("right_shoulder", 14),
            ("left_elbow", 16),
            ("right_elbow", 17),
            ("left_wrist", 18),
            ("right_wrist", 19),
            ("left_hand", 20),
            ("right_hand", 21),
        ];
        Self {
            names: JOINTS.iter().map(|(n, _)| (*n).to_owned()).collect(),
            parents: JOINTS.iter().map(|(_, p)| u8::try_from(*p).ok()).collect(),
        }
    }
    /// Joints `J`.
    pub fn len(&self) -> usize {
        self.names.len()
    }
    /// Whether there is no joint.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }
    /// `[j][k]`: whether bone `k` is joint `j`'s own or hangs below it.
    pub fn descendants(&self) -> Vec<Vec<bool>> {
        let mut below = vec![vec![false; self.len()]; self.len()];
        for k in 0..self.len() {
            let mut at = Some(k);
            while let Some(j) = at {
                below[j][k] = true;
                at = self.parents[j].map(usize::from);
            }
        }
        below
    }
    /// `[J]` whether a joint is the root or bends the trunk: spine, neck, collars.
    pub fn trunk(&self) -> Vec<bool> {
        let bends = |name: &String| ["spine", "neck", "collar"].iter().any(|part| name.contains(part));
        self.names.iter().enumerate().map(|(j, name)| j == 0 || bends(name)).collect()
    }

    /// Index of a joint by name.
    pub fn index(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }
}

impl BodyModel {
    /// Vertices `V`.
    pub fn vertex_count(&self) -> usize {
        self.template.len()
    }
    /// Joints `J`.
    pub fn joint_count(&self) -> usize {
        self.skeleton.len()
    }
    /// Shape coefficients `S`.
    pub fn shape_count(&self) -> usize {
        self.shape_directions.len() / self.template.len().max(1)
    }
}
