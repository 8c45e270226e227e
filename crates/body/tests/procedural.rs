//! The procedural human at both levels: a closed symmetric mesh, sound weights and charts, a shape space whose
//! second coefficient is body mass, and bodies that stay sound from BMI 18 to 33.

use glam::Vec3;
use softtissue_body::procedural::{Anatomy, Levels, ProceduralBody, ProceduralConfig, generate, generate_levels};
use softtissue_body::{BodyBuild, BodyModel, Pose, Region};
use softtissue_geometry::{face_normals, signed_volume, vertex_normals};
use softtissue_random::Draws;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

fn levels() -> &'static Levels {
    static LEVELS: OnceLock<Levels> = OnceLock::new();
    LEVELS.get_or_init(|| generate_levels(&ProceduralConfig::default()).expect("the default body"))
}

fn bodies() -> [(&'static str, &'static ProceduralBody); 2] {
    [("level 0", &levels().coarse), ("level 1", &levels().fine)]
}

fn flip(p: Vec3) -> Vec3 {
    Vec3::new(-p.x, p.y, p.z)
}

/// A beta with standard normal entries.
fn random_beta(n: usize, draw: u64) -> Vec<f32> {
    let mut draws = Draws::new(5, "test/beta", 0, draw);
    (0..n).map(|_| draws.normal() as f32).collect()
}

#[test]
fn both_levels_are_closed_manifolds_of_genus_zero() {
    let [(_, coarse), (_, fine)] = bodies();
    assert_eq!(coarse.model.vertex_count(), 1724);
    assert_eq!(fine.model.vertex_count(), 4 * coarse.model.vertex_count() - 6);
    for (name, body) in bodies() {
        let t = &body.model.topology;
        assert_eq!(t.check_closed_manifold(), Ok(0), "{name}");
        assert_eq!(t.faces.len(), 2 * t.quads.len(), "{name}");
        for (q, quad) in t.quads.iter().enumerate() {
            let corners: BTreeSet<u32> = t.faces[2 * q].iter().chain(&t.faces[2 * q + 1]).copied().collect();
            assert_eq!(corners, quad.iter().copied().collect(), "{name}: quad {q}");
        }
        let mut valence = vec![0; t.vertex_count];
        t.quads.iter().flatten().for_each(|v| valence[*v as usize] += 1);
        assert!(valence.iter().all(|n| (3..=6).contains(n)), "{name}: valences outside 3 to 6");
    }
}

#[test]
fn the_mirror_is_exact() {
    for (name, body) in bodies() {
        let m = &body.model;
        let (v, j) = (m.vertex_count(), m.joint_count());
        let mirror = &m.mirror;
        assert!((0..v).all(|i| mirror.vertices[mirror.vertices[i] as usize] as usize == i), "{name}");
        assert!((0..j).all(|i| mirror.joints[mirror.joints[i] as usize] as usize == i), "{name}");
        let fields = std::iter::once(&m.template[..]).chain(m.shape_directions.chunks_exact(v));
        for (k, field) in fields.enumerate() {
            let exact = (0..v).all(|i| field[mirror.vertices[i] as usize] == flip(field[i]));
            assert!(exact, "{name}: field {k} is not symmetric");
        }
        let faces: BTreeSet<[u32; 3]> = m.topology.faces.iter().map(|f| rotated(*f)).collect();
        let mirrored = m.topology.faces.iter().map(|f| f.map(|i| mirror.vertices[i as usize]));
        assert!(mirrored.into_iter().all(|[a, b, c]| faces.contains(&rotated([a, c, b]))), "{name}: faces");
        for i in 0..v {
            let o = mirror.vertices[i] as usize;
            let swapped: BTreeMap<u8, f32> = weights_of(m, i).map(|(j, w)| (mirror.joints[j as usize], w)).collect();
            assert_eq!(swapped, weights_of(m, o).collect(), "{name}: weights of {i} and {o}");
            assert_eq!(m.regions.0[i], m.regions.0[o], "{name}: regions of {i} and {o}");
        }
        // features of a mirrored pose change sign with each x index
        for joint in 1..j {
            for entry in 0..9 {
                let sign = if (entry / 3 == 0) != (entry % 3 == 0) { -1.0 } else { 1.0 };
                let own = &m.pose_directions[(9 * (joint - 1) + entry) * v..][..v];
                let other = &m.pose_directions[(9 * (mirror.joints[joint] as usize - 1) + entry) * v..][..v];
                let exact = (0..v).all(|i| other[mirror.vertices[i] as usize] == flip(own[i]) * sign);
                assert!(exact, "{name}: corrective {entry} of joint {joint}");
            }
        }
        let joints = m.shaped(&random_beta(m.shape_count(), 0)).joints;
        for i in 0..j {
            let d = joints[mirror.joints[i] as usize].distance(flip(joints[i]));
            assert!(d < 1e-6, "{name}: joint {i} is {d} off its mirror image");
        }
    }
}

fn rotated(f: [u32; 3]) -> [u32; 3] {
    let k = (0..3).min_by_key(|k| f[*k]).unwrap_or(0);
    [f[k], f[(k + 1) % 3], f[(k + 2) % 3]]
}

fn weights_of(m: &BodyModel, v: usize) -> impl Iterator<Item = (u8, f32)> {
    let s = m.skin[v];
    s.joints.into_iter().zip(s.weights).filter(|(_, w)| *w > 0.0)
}

#[test]
fn weights_are_few_positive_and_sum_to_one() {
    for (name, body) in bodies() {
        for (v, s) in body.model.skin.iter().enumerate() {
            let sum: f32 = s.weights.iter().sum();
            assert!((sum - 1.0).abs() < 1e-6 && s.weights.iter().all(|w| *w >= 0.0), "{name}: vertex {v} {s:?}");
            assert!(s.weights.is_sorted_by(|a, b| a >= b), "{name}: vertex {v} {s:?}");
        }
        for (j, row) in body.model.joint_regressor.rows.iter().enumerate() {
            let sum: f32 = row.iter().map(|(_, w)| w).sum();
            assert!((sum - 1.0).abs() < 1e-5 && row.len() <= 64, "{name}: joint {j} sums to {sum}");
        }
        // every joint turns something
        let used: BTreeSet<u8> =
            (0..body.model.vertex_count()).flat_map(|v| weights_of(&body.model, v)).map(|w| w.0).collect();
        assert_eq!(used, (0..24).collect(), "{name}");
        body.model.check().expect("a consistent body");
    }
}

#[test]
fn the_second_coefficient_is_body_mass_and_the_first_stature() {
    let anatomy = &levels().coarse.anatomy;
    let n = 400;
    let betas: Vec<Vec<f32>> = (0..n).map(|i| random_beta(anatomy.shape_count(), i)).collect();
    let column = |k: usize| betas.iter().map(|b| f64::from(b[k])).collect::<Vec<_>>();
    let bmi: Vec<f64> = betas.iter().map(|b| anatomy.bmi(b)).collect();
    let height: Vec<f64> = betas.iter().map(|b| anatomy.height(b)).collect();
    let mass = correlation(&column(1), &bmi);
    let stature = correlation(&column(0), &height);
    println!("correlation of beta[1] with BMI {mass:.3}, of beta[0] with stature {stature:.3}");
    assert!(mass <= -0.9, "{mass}");
    assert!(stature >= 0.9, "{stature}");
}

fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let n = x.len() as f64;
    let (mx, my) = (x.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let cov = |a: &[f64], ma: f64, b: &[f64], mb: f64| a.iter().zip(b).map(|(a, b)| (a - ma) * (b - mb)).sum::<f64>();
    cov(x, mx, y, my) / (cov(x, mx, x, mx) * cov(y, my, y, my)).sqrt()
}

#[test]
fn bodies_stay_sound_from_bmi_18_to_33() {
    for (name, body) in bodies() {
        let faces = &body.model.topology.faces;
        for bmi in [18.0, 20.0, 23.0, 28.0, 33.0] {
            for person in 0..3 {
                // three people who differ in all but mass
                let mut beta: Vec<f32> =
                    random_beta(body.model.shape_count(), person).iter().map(|b| b * 0.6).collect();
                if person == 0 {
                    beta.fill(0.0);
                }
                let beta = body.anatomy.beta_for_bmi(bmi, &beta).expect("a reachable BMI");
                let x = body.model.shaped(&beta).vertices;
                let volume = signed_volume(&x, faces);
                let (low, high) = x.iter().fold((f32::MAX, f32::MIN), |(l, h), p| (l.min(p.y), h.max(p.y)));
                let measured = volume * 1010.0 / f64::from(high - low).powi(2);
                assert!((measured - bmi).abs() < 0.25, "{name}: asked for {bmi}, the mesh measures {measured:.2}");
                let normals = vertex_normals(&x, faces);
                for (f, n) in faces.iter().zip(face_normals(&x, faces)) {
                    let around: Vec3 = f.iter().map(|i| normals[*i as usize]).sum();
                    let longest = (0..3).map(|k| x[f[k] as usize].distance_squared(x[f[(k + 1) % 3] as usize]));
                    let longest = longest.fold(0.0, f32::max);
                    assert!(n.dot(around) > 0.0, "{name}: BMI {bmi}, person {person}: face {f:?} is turned inside out");
                    assert!(n.length() > 0.03 * longest, "{name}: BMI {bmi}, person {person}: face {f:?} is a sliver");
                }
            }
        }
    }
}

#[test]
fn the_same_configuration_gives_the_same_bytes() {
    let config = ProceduralConfig { people: 24, level: 0, ..Default::default() };
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str| {
        let body = generate(&config).unwrap();
        let path = folder.path().join(name);
        body.model.write(&path).unwrap();
        (std::fs::read(&path).unwrap(), serde_json::to_string(&body.anatomy).unwrap())
    };
    let (one, two) = (bytes("a"), bytes("b"));
    assert!(one == two);
    let other = generate(&ProceduralConfig { seed: 2, ..config }).unwrap();
    assert!(serde_json::to_string(&other.anatomy).unwrap() != one.1, "the seed must matter");
}

#[test]
fn charts_lie_in_the_unit_square_and_do_not_overlap() {
    for (name, body) in bodies() {
        let uv = &body.model.uv;
        assert_eq!(uv.faces.len(), body.model.topology.faces.len());
        assert!(uv.coordinates.iter().all(|c| (0.0..=1.0).contains(&c.x) && (0.0..=1.0).contains(&c.y)), "{name}");
        let mut covered = 0.0;
        for f in &uv.faces {
            let [a, b, c] = f.map(|i| uv.coordinates[i as usize]);
            let area = 0.5 * (b - a).perp_dot(c - a);
            assert!(area > 0.0, "{name}: a folded triangle in the atlas");
            covered += area;
        }
        let charts = charts(uv.coordinates.len(), &uv.faces);
        println!("{name}: {} charts cover {:.0} % of the atlas", charts.len(), covered * 100.0);
        assert!(charts.len() <= 60 && covered > 0.35, "{name}: {} charts, {covered} covered", charts.len());
        let boxes: Vec<_> = charts
            .iter()
            .map(|chart| {
                let points = chart.iter().map(|i| uv.coordinates[*i as usize]);
                points.fold((glam::Vec2::MAX, glam::Vec2::MIN), |(l, h), p| (l.min(p), h.max(p)))
            })
            .collect();
        for (i, a) in boxes.iter().enumerate() {
            for b in &boxes[..i] {
                let apart = a.1.x < b.0.x || b.1.x < a.0.x || a.1.y < b.0.y || b.1.y < a.0.y;
                assert!(apart, "{name}: two charts overlap");
            }
        }
        // corner for corner with the mesh: one coordinate belongs to one vertex
        let mut owner = vec![None; uv.coordinates.len()];
        for (f, t) in uv.faces.iter().flatten().zip(body.model.topology.faces.iter().flatten()) {
            assert_eq!(*owner[*f as usize].get_or_insert(*t), *t, "{name}");
        }
    }
}

fn charts(count: usize, faces: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut parent: Vec<usize> = (0..count).collect();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for f in faces {
        for k in 1..3 {
            let (a, b) = (root(&mut parent, f[0] as usize), root(&mut parent, f[k] as usize));
            parent[a] = b;
        }
    }
    let mut out: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
    for i in 0..count {
        out.entry(root(&mut parent, i)).or_default().push(i as u32);
    }
    out.into_values().collect()
}

#[test]
fn correctives_give_back_volume_at_bent_joints_and_stay_bounded() {
    for (name, body) in bodies() {
        let m = &body.model;
        let plain = BodyModel { pose_directions: vec![Vec3::ZERO; m.pose_directions.len()], ..m.clone() };
        let shaped = m.shaped(&[]);
        let rest = signed_volume(&shaped.vertices, &m.topology.faces);
        for (joint, w) in [("left_knee", Vec3::X * 1.5), ("left_elbow", Vec3::Y * -1.5), ("left_hip", Vec3::X * -1.3)] {
            let mut rotations = vec![Vec3::ZERO; m.joint_count()];
            rotations[m.skeleton.index(joint).unwrap()] = w;
            let pose = Pose { rotations: &rotations, translation: Vec3::ZERO };
            let lost = |m: &BodyModel| (signed_volume(&m.posed(&shaped, pose, None), &m.topology.faces) - rest).abs();
            assert!(lost(m) < 0.8 * lost(&plain), "{name} {joint}: {:e} with, {:e} without", lost(m), lost(&plain));
            let largest = m.pose_offsets(&rotations).iter().map(|d| d.length()).fold(0.0, f32::max);
            assert!((0.002..0.035).contains(&largest), "{name} {joint}: a corrective of {largest} m");
        }
    }
}

#[test]
fn regions_are_there_and_lie_where_they_should() {
    for (name, body) in bodies() {
        let m = &body.model;
        let mean = |r: Region| {
            let v = m.regions.vertices(r);
            assert!(v.len() * 100 > m.vertex_count(), "{name}: {r:?} has {} vertices", v.len());
            v.iter().map(|i| m.template[*i as usize]).sum::<Vec3>() / v.len() as f32
        };
        let order = [Region::Feet, Region::Calves, Region::Thighs, Region::Belly, Region::Chest, Region::Head];
        assert!(order.windows(2).all(|w| mean(w[0]).y < mean(w[1]).y), "{name}");
        assert!(
            mean(Region::Buttocks).z < -0.05 && mean(Region::Chest).z > 0.03 && mean(Region::Belly).z > 0.0,
            "{name}"
        );
        let soft = m.regions.soft().len() as f64 / m.vertex_count() as f64;
        assert!((0.2..0.7).contains(&soft), "{name}: {soft} of the vertices are soft");
    }
}

#[test]
fn anatomy_measures_the_mesh_and_survives_a_file() {
    for (name, body) in bodies() {
        let a = &body.anatomy;
        for i in 0..4 {
            let beta = random_beta(a.shape_count(), 50 + i);
            let x = body.model.shaped(&beta).vertices;
            let volume = signed_volume(&x, &body.model.topology.faces);
            assert!((a.volume(&beta) - volume).abs() < 1e-5 * volume, "{name}: {} {volume}", a.volume(&beta));
            let same: Anatomy = serde_json::from_str(&serde_json::to_string(a).unwrap()).unwrap();
            assert_eq!(&same, a);
        }
        let heavy = a.beta_for_bmi(31.0, &[0.5, 9.0, -0.3]).unwrap();
        assert!((a.bmi(&heavy) - 31.0).abs() < 1e-3 && heavy[0] == 0.5 && heavy[2] == -0.3, "{name}");
        assert!(a.beta_for_bmi(90.0, &[]).is_err());
        let (thin, thick) = (a.fat_thickness(&a.beta_for_bmi(19.0, &[]).unwrap()), a.fat_thickness(&heavy));
        for v in body.model.regions.vertices(Region::Belly) {
            assert!(thick[v as usize] > 1.5 * thin[v as usize], "{name}: fat of vertex {v}");
        }
        let back =
            a.parameters(&a.beta_for(softtissue_body::procedural::ShapeParameters { mass: 1.0, ..Default::default() }));
        assert!((back.mass - 1.0).abs() < 0.1 && back.height.abs() < 0.1, "{name}: {back:?}");
    }
}

/// What is derived from the model alone is near what the generator knew when it made it.
#[test]
fn flesh_is_known_of_a_body_that_somebody_else_made() {
    for (name, body) in bodies() {
        let derived = Anatomy::of(&body.model).unwrap();
        let mut worst = [0.0f32; 3];
        // Muscle and build change the index too, which only the generator can tell from fat: this is mass alone.
        for bmi in [19.0, 23.0, 27.0, 31.0] {
            let beta = body.anatomy.beta_for_bmi(bmi, &[]).unwrap();
            let (a, b) = (derived.parameters(&beta), body.anatomy.parameters(&beta));
            worst[0] = worst[0].max((a.height - b.height).abs());
            worst[1] = worst[1].max((a.mass - b.mass).abs());
            assert_eq!(derived.bmi(&beta), body.anatomy.bmi(&beta));
            let (found, made) = (derived.fat_thickness(&beta), body.anatomy.fat_thickness(&beta));
            let off: f32 = found.iter().zip(&made).map(|(a, b)| (a - b).abs()).sum();
            worst[2] = worst[2].max(off / made.iter().sum::<f32>());
        }
        println!("{name}: height knob {:.2}, mass knob {:.2}, fat {:.0} %", worst[0], worst[1], 100.0 * worst[2]);
        // The neutral index is that of level 0; the finer mesh of the same people holds more volume.
        assert!(worst[0] < 0.05 && worst[1] < 0.25 && worst[2] < 0.15, "{name}: {worst:?}");
    }
    let mut other = bodies()[0].1.model.clone();
    other.skeleton.parents[15] = Some(9);
    assert!(Anatomy::of(&other).unwrap_err().to_string().contains("24 joints are not those"));
}

#[test]
fn bones_lie_inside_and_their_distance_has_its_gradient() {
    for (name, body) in bodies() {
        for bmi in [18.0, 23.0, 33.0] {
            let beta = body.anatomy.beta_for_bmi(bmi, &[]).unwrap();
            let shaped = body.model.shaped(&beta);
            let bones = body.anatomy.bones(&beta, &shaped.joints);
            let pierced: BTreeSet<(u8, usize)> = (bones.bones.iter())
                .flat_map(|b| (0..shaped.vertices.len()).map(move |v| (b, v)))
                .filter(|(b, v)| b.distance(shaped.vertices[*v]).0 <= 0.0)
                .map(|(b, v)| (b.joint, v))
                .collect();
            assert!(pierced.is_empty(), "{name}, BMI {bmi}: (joint, vertex) where bones pierce the skin: {pierced:?}");
            for p in shaped.vertices.iter().step_by(37) {
                let (_, g) = bones.distance(*p, 0.03);
                for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                    let h = 2e-3;
                    let numeric =
                        (bones.distance(*p + axis * h, 0.03).0 - bones.distance(*p - axis * h, 0.03).0) / (2.0 * h);
                    assert!((numeric - g.dot(axis)).abs() < 0.03, "{name}: {numeric} {}", g.dot(axis));
                }
            }
        }
    }
}

#[test]
fn subdivision_keeps_affine_fields_and_joins_the_levels() {
    let Levels { coarse, fine, subdivision } = levels();
    assert_eq!(subdivision.coarse_count(), coarse.model.vertex_count());
    assert_eq!(subdivision.fine_count(), fine.model.vertex_count());
    let ones = subdivision.lift_scalar(&vec![1.0; subdivision.coarse_count()]);
    assert!(ones.iter().all(|x| (x - 1.0).abs() < 1e-5));
    let affine = |p: &Vec3| Vec3::new(p.y - 2.0 * p.x, p.z + 0.3, p.x);
    let lifted = subdivision.lift(&coarse.model.template);
    let field = subdivision.lift(&coarse.model.template.iter().map(affine).collect::<Vec<_>>());
    assert!(lifted.iter().zip(&field).all(|(p, f)| affine(p).distance(*f) < 1e-5));
    let beta = random_beta(fine.model.shape_count(), 9);
    let lifted = subdivision.lift(&coarse.model.shaped(&beta).vertices);
    let own = fine.model.shaped(&beta).vertices;
    let mean = lifted.iter().zip(&own).map(|(a, b)| a.distance(*b)).sum::<f32>() / own.len() as f32;
    assert!(mean < 0.006, "the same beta means other bodies at the two levels: {mean} m apart on average");
}

/// The linear map of shape to build against the exact volume and stature, over people as the shape space has them and
/// over the range of body masses; the same at both levels.
#[test]
fn weight_height_and_index_are_nearly_linear_in_the_shape() {
    for (name, body) in bodies() {
        let (build, anatomy) = (BodyBuild::fit(&body.model), &body.anatomy);
        let mut errors: Vec<f64> = (0..200)
            .map(|i| {
                let beta = random_beta(body.model.shape_count(), i);
                assert!((f64::from(build.height(&beta)) - anatomy.height(&beta)).abs() < 1e-4, "{name}");
                (f64::from(build.bmi(&beta)) - anatomy.bmi(&beta)).abs()
            })
            .collect();
        errors.sort_by(f64::total_cmp);
        let (median, most, worst) = (errors[100], errors[190], errors[199]);
        assert!(median < 0.03 && most < 0.15 && worst < 0.5, "{name}: {median} {most} {worst} kg/m^2");
        for bmi in [18.0, 23.0, 28.0, 33.0] {
            let other = build.at_bmi(&[], bmi as f32).unwrap();
            assert!((anatomy.bmi(&other) - bmi).abs() < 0.4, "{name}: {bmi} became {}", anatomy.bmi(&other));
            assert!((anatomy.height(&other) - anatomy.height(&[])).abs() < 1e-3, "{name}");
        }
    }
}
