use super::config::RegistrationConfig;
use crate::pose_state::{Kinematics, PoseState};
use crate::weights::region_weights;
use glam::{Affine3A, Vec3};
use rayon::prelude::*;
use softtissue_body::{BodyModel, Region, ShapedBody};
use softtissue_clips::RawFrame;
use softtissue_geometry::{Adjacency, SurfaceTree, vertex_normals};

/// What is the same for all subjects and frames.
pub(crate) struct Registrar<'a> {
    pub body: &'a BodyModel,
    pub config: &'a RegistrationConfig,
    pub parents: Vec<Option<usize>>,
    /// For each vertex the joints that move it and the weight of the bones at or below them.
    pub chains: Vec<Vec<(usize, f32)>>,
    pub adjacency: Adjacency,
    /// High where bone lies under the skin, `[V]`: steers the pose.
    pub rigid: Vec<f32>,
    /// Coupling of each vertex to the model, `[V]`.
    pub coupling: Vec<f32>,
    /// Whether quality is judged there: everything but hands, feet and head, `[V]`.
    pub judged: Vec<bool>,
}

impl<'a> Registrar<'a> {
    pub fn new(body: &'a BodyModel, config: &'a RegistrationConfig) -> Self {
        let parents: Vec<Option<usize>> = body.skeleton.parents.iter().map(|p| p.map(usize::from)).collect();
        let chain = |skin: &softtissue_body::SkinWeights| {
            let mut sums = vec![0.0f32; parents.len()];
            for (bone, weight) in skin.joints.iter().zip(skin.weights) {
                let mut at = Some(usize::from(*bone)).filter(|_| weight > 0.0);
                while let Some(j) = at {
                    sums[j] += weight;
                    at = parents[j];
                }
            }
            sums.into_iter().enumerate().filter(|(_, w)| *w > 0.0).collect()
        };
        let chains = body.skin.iter().map(chain).collect();
        let judged: Vec<bool> =
            body.regions.0.iter().map(|r| !matches!(r, Region::Hands | Region::Feet | Region::Head)).collect();
        let strength = |judged: &bool| config.coupling * if *judged { 1.0 } else { config.extremity_coupling };
        Self {
            body,
            config,
            chains,
            adjacency: Adjacency::new(&body.topology),
            rigid: region_weights(&body.regions),
            coupling: judged.iter().map(strength).collect(),
            judged,
            parents,
        }
    }

    /// The body of a shape at a pose, with a displacement of the rest mesh.
    pub fn posed(&self, shaped: &ShapedBody, state: &PoseState, displacement: &[Vec3]) -> Posed {
        let kinematics = Kinematics::new(&self.parents, &shaped.joints, state);
        let offsets = self.body.pose_offsets_of_features(std::slice::from_ref(&kinematics.features));
        let rest: Vec<Vec3> = shaped.vertices.iter().zip(&offsets[0]).map(|(x, o)| *x + *o).collect();
        let posed_from_rest: Vec<Affine3A> = self.body.skin.iter().map(|s| s.blend(&kinematics.transforms)).collect();
        let mut posed = Posed { kinematics, rest, posed_from_rest, vertices: vec![], normals: vec![] };
        posed.displace(self, displacement);
        posed
    }

    /// Where the points of a scan lie on a posed body; every `stride`-th point is asked. Points count by how near they
    /// are, on the scale of `outlier`, metres.
    pub fn pairs(&self, posed: &Posed, scan: &RawFrame, stride: usize, reach: f32, outlier: f32) -> Vec<Pair> {
        self.pairs_on(&posed.vertices, &posed.normals, scan, stride, reach, outlier)
    }

    /// [`Self::pairs`] on a surface of vertices and their normals.
    pub fn pairs_on(
        &self,
        vertices: &[Vec3],
        normals: &[Vec3],
        scan: &RawFrame,
        stride: usize,
        reach: f32,
        outlier: f32,
    ) -> Vec<Pair> {
        let faces = &self.body.topology.faces;
        let tree = SurfaceTree::new(vertices, faces);
        let pair = |i: usize| {
            let point = scan.points[i];
            let normal = scan.normals.get(i).copied().unwrap_or(Vec3::ZERO);
            let place = tree.closest(point, normal, reach)?;
            let corners = faces[place.face as usize];
            let [a, b, c] = corners.map(|v| normals[v as usize]);
            let [u, v, w] = place.weights;
            let normal = (a * u + b * v + c * w).normalize_or_zero();
            let robust = outlier * outlier / (outlier * outlier + place.distance * place.distance);
            let weight = robust * robust;
            Some(Pair { corners, weights: place.weights, point, normal, weight, distance: place.distance })
        };
        (0..scan.points.len()).into_par_iter().step_by(stride).with_min_len(256).filter_map(pair).collect()
    }
}

/// A body at a pose.
pub(crate) struct Posed {
    pub kinematics: Kinematics,
    /// Shaped rest vertices with pose correctives, without displacement, `[V]`.
    pub rest: Vec<Vec3>,
    /// `[V]`.
    pub posed_from_rest: Vec<Affine3A>,
    /// `[V]`, metres.
    pub vertices: Vec<Vec3>,
    /// Unit normals, `[V]`.
    pub normals: Vec<Vec3>,
}

impl Posed {
    /// The same pose with another displacement of the rest mesh.
    pub fn displace(&mut self, registrar: &Registrar, displacement: &[Vec3]) {
        let moved = |(a, (x, d)): (&Affine3A, (&Vec3, &Vec3))| a.transform_point3(*x + *d);
        self.vertices = self.posed_from_rest.iter().zip(self.rest.iter().zip(displacement)).map(moved).collect();
        self.normals = vertex_normals(&self.vertices, &registrar.body.topology.faces);
    }
}

/// A scan point and where it lies on the body.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    pub corners: [u32; 3],
    /// Of the corners; sum one.
    pub weights: [f32; 3],
    /// Of the scan, metres.
    pub point: Vec3,
    /// Of the body there, unit length.
    pub normal: Vec3,
    /// How much the point counts, 0 to 1.
    pub weight: f32,
    /// Metres.
    pub distance: f32,
}

impl Pair {
    /// Interpolates a field over the vertices.
    pub fn interpolate(&self, field: &[Vec3]) -> Vec3 {
        self.corners.iter().zip(self.weights).map(|(v, w)| field[*v as usize] * w).sum()
    }
    /// The corner that weighs most.
    pub fn nearest(&self) -> usize {
        let best = (0..3).max_by(|a, b| self.weights[*a].total_cmp(&self.weights[*b])).unwrap_or(0);
        self.corners[best] as usize
    }
}
