//! SMPL's formulas in f64 with plain loops over 4 x 4 matrices: written to share nothing with the crate.

use glam::{Vec2, Vec3};
use softtissue_body::{BodyModel, JointRegressor, Mirror, Region, RegionMap, Skeleton, SkinWeights, UvAtlas};
use softtissue_geometry::Topology;
use softtissue_random::Draws;
use std::sync::Arc;

pub type Matrix = [[f64; 4]; 4];
pub type Point = [f64; 3];

/// What a pose, a shape and deltas are to the reference.
#[derive(Clone)]
pub struct Input {
    pub angles: Vec<Point>,
    pub translation: Point,
    pub beta: Vec<f64>,
}

impl Input {
    pub fn parameters(&self) -> usize {
        3 * self.angles.len() + 3 + self.beta.len()
    }
    /// Parameter `i` in the order of the crate's Jacobian.
    pub fn at(&mut self, i: usize) -> &mut f64 {
        let angles = 3 * self.angles.len();
        if i < angles {
            &mut self.angles[i / 3][i % 3]
        } else if i < angles + 3 {
            &mut self.translation[i - angles]
        } else {
            &mut self.beta[i - angles - 3]
        }
    }
    pub fn rotations(&self) -> Vec<Vec3> {
        self.angles.iter().map(|a| single(*a)).collect()
    }
}

pub fn single(p: Point) -> Vec3 {
    Vec3::from_array(p.map(|x| x as f32))
}

fn double(p: Vec3) -> Point {
    p.to_array().map(f64::from)
}

fn rodrigues(w: Point) -> [[f64; 3]; 3] {
    let angle = (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]).sqrt();
    let mut r = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    if angle > 0.0 {
        let [x, y, z] = w.map(|c| c / angle);
        let k = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]];
        for i in 0..3 {
            for j in 0..3 {
                let square: f64 = (0..3).map(|m| k[i][m] * k[m][j]).sum();
                r[i][j] += angle.sin() * k[i][j] + (1.0 - angle.cos()) * square;
            }
        }
    }
    r
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut c = [[0.0; 4]; 4];
    for i in 0..4 {
        for j in 0..4 {
            c[i][j] = (0..4).map(|k| a[i][k] * b[k][j]).sum();
        }
    }
    c
}

pub fn apply(m: &Matrix, p: Point) -> Point {
    std::array::from_fn(|i| m[i][0] * p[0] + m[i][1] * p[1] + m[i][2] * p[2] + m[i][3])
}

/// The rest point that `m` takes to `p`, by Cramer's rule.
fn solve(m: &Matrix, p: Point) -> Point {
    let det = |c: [Point; 3]| {
        c[0][0] * (c[1][1] * c[2][2] - c[2][1] * c[1][2]) - c[1][0] * (c[0][1] * c[2][2] - c[2][1] * c[0][2])
            + c[2][0] * (c[0][1] * c[1][2] - c[1][1] * c[0][2])
    };
    let columns: [Point; 3] = std::array::from_fn(|j| std::array::from_fn(|i| m[i][j]));
    let right: Point = std::array::from_fn(|i| p[i] - m[i][3]);
    let whole = det(columns);
    std::array::from_fn(|j| {
        let mut replaced = columns;
        replaced[j] = right;
        det(replaced) / whole
    })
}

/// Rest vertices without deltas `T + Bs + Bp`, and the blended transform of each vertex.
fn rest_and_transforms(body: &BodyModel, input: &Input) -> (Vec<Point>, Vec<Matrix>) {
    let v = body.vertex_count();
    let mut rest: Vec<Point> = body.template.iter().map(|p| double(*p)).collect();
    for (s, b) in input.beta.iter().enumerate() {
        for i in 0..v {
            for c in 0..3 {
                rest[i][c] += b * double(body.shape_directions[s * v + i])[c];
            }
        }
    }
    let mut joints = vec![[0.0; 3]; body.joint_count()];
    for (joint, row) in joints.iter_mut().zip(&body.joint_regressor.rows) {
        for (i, w) in row {
            for c in 0..3 {
                joint[c] += f64::from(*w) * rest[*i as usize][c];
            }
        }
    }
    let rotations: Vec<_> = input.angles.iter().map(|w| rodrigues(*w)).collect();
    for (j, r) in rotations.iter().enumerate().skip(1) {
        for entry in 0..9 {
            let (row, column) = (entry / 3, entry % 3);
            let feature = r[row][column] - if row == column { 1.0 } else { 0.0 };
            for i in 0..v {
                for c in 0..3 {
                    rest[i][c] += feature * double(body.pose_directions[(9 * (j - 1) + entry) * v + i])[c];
                }
            }
        }
    }
    let mut world: Vec<Matrix> = vec![];
    for j in 0..joints.len() {
        let parent = body.skeleton.parents[j].map(usize::from);
        let mut local = [[0.0; 4]; 4];
        for a in 0..3 {
            local[a][..3].copy_from_slice(&rotations[j][a]);
            local[a][3] = joints[j][a] - parent.map_or(0.0, |p| joints[p][a]);
        }
        local[3][3] = 1.0;
        world.push(parent.map_or(local, |p| product(&world[p], &local)));
    }
    let transforms = body.skin.iter().map(|skin| {
        let mut sum = [[0.0; 4]; 4];
        for (k, w) in skin.joints.iter().zip(skin.weights) {
            let mut without_rest = [[0.0; 4]; 4];
            for a in 0..3 {
                without_rest[a][a] = 1.0;
                without_rest[a][3] = -joints[*k as usize][a];
            }
            without_rest[3][3] = 1.0;
            let m = product(&world[*k as usize], &without_rest);
            for a in 0..4 {
                for b in 0..4 {
                    sum[a][b] += f64::from(w) * m[a][b];
                }
            }
        }
        for a in 0..3 {
            // the weights' rounding times the translation stays as it is in the crate: weights scale it too
            sum[a][3] += input.translation[a] * skin.weights.iter().map(|w| f64::from(*w)).sum::<f64>();
        }
        sum
    });
    (rest, transforms.collect())
}

pub fn posed(body: &BodyModel, input: &Input, deltas: &[Vec3]) -> Vec<Point> {
    let (rest, transforms) = rest_and_transforms(body, input);
    (0..rest.len())
        .map(|i| {
            let d = double(deltas[i]);
            apply(&transforms[i], std::array::from_fn(|c| rest[i][c] + d[c]))
        })
        .collect()
}

pub fn unposed_deltas(body: &BodyModel, input: &Input, posed: &[Point]) -> Vec<Point> {
    let (rest, transforms) = rest_and_transforms(body, input);
    (0..rest.len())
        .map(|i| {
            let u = solve(&transforms[i], posed[i]);
            std::array::from_fn(|c| u[c] - rest[i][c])
        })
        .collect()
}

/// A random body whose right half is the mirror image of its left half: `v` vertices of which the last is
/// central, SMPL's joints.
pub fn random_body(v: usize) -> BodyModel {
    const JOINT_MIRROR: [u8; 24] =
        [0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20, 23, 22];
    assert!(v % 2 == 1, "one central vertex");
    let mut draws = Draws::new(11, "random body", 0, 0);
    let half = v / 2;
    let mirror: Vec<u32> = (0..v).map(|i| if i == v - 1 { i } else { (i + half) % (2 * half) } as u32).collect();
    let mut field = |scale: f64| {
        let mut points: Vec<Vec3> =
            (0..v).map(|_| Vec3::from_array([0; 3].map(|_: i32| (scale * draws.normal()) as f32))).collect();
        for i in 0..half {
            points[i + half] = Vec3::new(-points[i].x, points[i].y, points[i].z);
        }
        points[v - 1].x = 0.0;
        points
    };
    let template = field(0.5);
    let shape_directions: Vec<Vec3> = (0..3).flat_map(|_| field(0.05)).collect();
    // correctives must answer a mirrored pose with the mirrored field: f(m(R)) = m(f(R)), where mirroring negates
    // the entries of R that cross the x axis
    let one_side: Vec<Vec<Vec3>> = (0..9 * 23).map(|_| field_free(&mut draws, v, 0.01)).collect();
    let reflect = |p: Vec3| Vec3::new(-p.x, p.y, p.z);
    let pose_directions = (0..9 * 23).flat_map(|p| {
        let (joint, entry) = (p / 9 + 1, p % 9);
        let other = 9 * (JOINT_MIRROR[joint] as usize - 1) + entry;
        let sign = if (entry / 3 == 0) == (entry % 3 == 0) { 1.0 } else { -1.0 };
        let (mirror, one_side) = (&mirror, &one_side);
        (0..v)
            .map(move |i| 0.5 * (one_side[p][i] + sign * reflect(one_side[other][mirror[i] as usize])))
            .collect::<Vec<_>>()
    });
    let pose_directions = pose_directions.collect();
    let mut skin = vec![SkinWeights { joints: [0; 4], weights: [1.0, 0.0, 0.0, 0.0] }; v];
    for i in 0..half {
        let count = 1 + i % 4;
        let order = draws.permutation(24);
        let mut weights = [0.0f32; 4];
        let total: f64 = (0..count).map(|k| 1.0 / (k + 1) as f64).sum();
        let mut joints = [0u8; 4];
        for k in 0..count {
            joints[k] = order[k] as u8;
            weights[k] = (1.0 / (k + 1) as f64 / total) as f32;
        }
        skin[i] = SkinWeights { joints, weights };
        let mirrored = std::array::from_fn(|k| if weights[k] > 0.0 { JOINT_MIRROR[joints[k] as usize] } else { 0 });
        skin[i + half] = SkinWeights { joints: mirrored, weights };
    }
    let mut rows: Vec<Vec<(u32, f32)>> = vec![vec![]; 24];
    for j in 0..24 {
        let other = JOINT_MIRROR[j] as usize;
        if other >= j {
            let chosen: Vec<u32> = (0..3).map(|_| draws.below(half) as u32).collect();
            rows[j] = if other == j {
                chosen.iter().flat_map(|&c| [(c, 1.0 / 6.0), (mirror[c as usize], 1.0 / 6.0)]).collect()
            } else {
                chosen.iter().map(|&c| (c, 1.0 / 3.0)).collect()
            };
            rows[other] = if other == j {
                rows[j].clone()
            } else {
                rows[j].iter().map(|(c, w)| (mirror[*c as usize], *w)).collect()
            };
        }
    }
    BodyModel {
        topology: Arc::new(Topology { vertex_count: v, faces: vec![], quads: vec![] }),
        template,
        shape_directions,
        pose_directions,
        joint_regressor: JointRegressor { rows },
        skin,
        skeleton: Skeleton::smpl(),
        uv: UvAtlas { coordinates: vec![Vec2::ZERO], faces: vec![] },
        mirror: Mirror { vertices: mirror, joints: JOINT_MIRROR.to_vec() },
        regions: RegionMap(vec![Region::Rest; v]),
    }
}

fn field_free(draws: &mut Draws, v: usize, scale: f64) -> Vec<Vec3> {
    (0..v).map(|_| Vec3::from_array([0; 3].map(|_: i32| (scale * draws.normal()) as f32))).collect()
}

/// A moderate random pose and shape whose numbers f32 holds exactly.
pub fn random_input(body: &BodyModel, step: u64, angle: f64) -> Input {
    let mut draws = Draws::new(11, "random input", 0, step);
    let mut exact = |scale: f64| f64::from((scale * draws.normal()) as f32);
    Input {
        angles: (0..body.joint_count()).map(|_| [exact(angle), exact(angle), exact(angle)]).collect(),
        translation: [exact(0.3), exact(0.3), exact(0.3)],
        beta: (0..body.shape_count()).map(|_| exact(1.0)).collect(),
    }
}
