//! Other readers see what was written: the `gltf` crate, and plain parsers of OBJ, point caches and USD's text. What other
//! programs make of the files, `scripts/validate-exports.sh` asks them.

use glam::{Vec2, Vec3};
use softtissue_export::{
    Animation, ExportError, GltfConfig, ObjFolder, PointCache, SurfaceFrame, Uv, write_gltf, write_obj_sequence,
    write_point_cache, write_usd,
};
use softtissue_geometry::{Frames, Topology};
use softtissue_monitor::{Monitor, Silent};
use std::path::Path;

/// Rings and points a ring of the test's tube.
const RINGS: usize = 24;
const AROUND: usize = 12;

/// A closed tube.
fn tube() -> Topology {
    let v = RINGS * AROUND;
    let mut faces = vec![];
    for k in 0..AROUND {
        let next = (k + 1) % AROUND;
        for r in 0..RINGS - 1 {
            let [a, b, c, d] =
                [r * AROUND + k, r * AROUND + next, (r + 1) * AROUND + next, (r + 1) * AROUND + k].map(|i| i as u32);
            faces.extend([[a, c, b], [a, d, c]]);
        }
        let top = (RINGS - 1) * AROUND;
        faces.extend([[v, k, next], [v + 1, top + next, top + k]].map(|f| f.map(|i| i as u32)));
    }
    let topology = Topology { vertex_count: v + 2, faces, quads: vec![] };
    assert_eq!(topology.check_closed_manifold(), Ok(0));
    topology
}

/// The tube travels, swings like a limb and carries travelling waves: no few targets hold it all.
fn motion(frames: usize) -> Frames {
    let mut out = Frames::new(RINGS * AROUND + 2);
    for t in 0..frames {
        let s = t as f32 / 60.0;
        let place = |ring: f32, angle: f32, radius: f32| {
            let bend = 0.8 * (5.0 * s).sin() * ring;
            let wave =
                0.01 * (30.0 * ring - 40.0 * s).sin() + 0.004 * (7.0 * angle + 25.0 * s).cos() * (11.0 * ring).sin();
            let local = Vec3::new((radius + wave * radius.signum()) * angle.cos(), 0.0, (radius + wave) * angle.sin());
            let axis = Vec3::new(bend.sin() * ring, bend.cos() * ring, 0.0);
            axis + glam::Quat::from_rotation_z(-bend) * local + Vec3::new(1.5 * s, (0.2 * (6.0 * s).sin()).abs(), 0.0)
        };
        let mut frame: Vec<Vec3> = (0..RINGS * AROUND)
            .map(|i| {
                place(
                    (i / AROUND) as f32 / RINGS as f32,
                    (i % AROUND) as f32 / AROUND as f32 * std::f32::consts::TAU,
                    0.1,
                )
            })
            .collect();
        frame.extend([place(-0.02, 0.0, 0.0), place(1.0, 0.0, 0.0)]);
        out.push(&frame);
    }
    out
}

/// Somebody who asked to stop.
struct Stopped;

impl Monitor for Stopped {
    fn begin(&self, _: &str, _: u64, _: &'static str) {}
    fn advance(&self, _: u64, _: &str) {}
    fn end(&self) {}
    fn say(&self, _: &str) {}
    fn should_stop(&self) -> bool {
        true
    }
}

/// Vertices of every frame as another reader computes them from the file.
fn read_back(path: &Path) -> (Frames, Vec<f32>) {
    let (document, buffers, _) = gltf::import(path).unwrap();
    let data = |buffer: gltf::Buffer| Some(&buffers[buffer.index()].0[..]);
    let node = document.default_scene().unwrap().nodes().next().unwrap();
    let primitive = node.mesh().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(data);
    let base: Vec<Vec3> = reader.read_positions().unwrap().map(Vec3::from).collect();
    let targets: Vec<Vec<Vec3>> =
        reader.read_morph_targets().map(|(p, _, _)| p.unwrap().map(Vec3::from).collect()).collect();
    let animation = document.animations().next().unwrap();
    let (mut times, mut translations, mut weights) = (vec![], vec![], vec![]);
    for channel in animation.channels() {
        assert_eq!(channel.target().node().index(), node.index());
        let reader = channel.reader(data);
        times = reader.read_inputs().unwrap().collect();
        match reader.read_outputs().unwrap() {
            gltf::animation::util::ReadOutputs::Translations(x) => translations = x.map(Vec3::from).collect(),
            gltf::animation::util::ReadOutputs::MorphTargetWeights(w) => weights = w.into_f32().collect(),
            _ => panic!("an unexpected channel"),
        }
    }
    let mut frames = Frames::new(base.len());
    for (t, translation) in translations.iter().enumerate() {
        let w = &weights[t * targets.len()..(t + 1) * targets.len()];
        let frame: Vec<Vec3> = (0..base.len())
            .map(|v| *translation + targets.iter().zip(w).fold(base[v], |x, (target, w)| x + target[v] * *w))
            .collect();
        frames.push(&frame);
    }
    (frames, times)
}

/// A motion at 60 frames a second.
fn animation<'a>(topology: &'a Topology, vertices: &'a Frames) -> Animation<'a> {
    Animation { name: "tube", topology, uv: None, fps: 60.0, vertices, extras: &serde_json::Value::Null }
}

/// `v` and `f` lines of an OBJ.
fn read_obj(path: &Path) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut faces) = (vec![], vec![]);
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[0] {
            "v" => vertices.push(Vec3::from_array([1, 2, 3].map(|i| words[i].parse().unwrap()))),
            "f" => faces.push([1, 2, 3].map(|i| words[i].split('/').next().unwrap().parse::<u32>().unwrap() - 1)),
            _ => {}
        }
    }
    (vertices, faces)
}

#[test]
fn gltf_and_obj_hold_the_same_motion_within_half_a_millimetre_on_every_frame() {
    let (topology, vertices) = (tube(), motion(90));
    let extras = serde_json::json!({"motion": "tube"});
    let animation = Animation { extras: &extras, ..animation(&topology, &vertices) };
    let dir = tempfile::tempdir().unwrap();
    let objs = write_obj_sequence(&dir.path().join("obj"), &animation, &Silent).unwrap();
    assert_eq!(objs.len(), 90);
    for file in ["tube.glb", "tube.gltf"] {
        let path = dir.path().join(file);
        let report = write_gltf(&path, &animation, &GltfConfig::default(), &Silent).unwrap();
        assert!(report.targets > 5 && report.targets < 60 && report.max_error_m <= 0.25e-3, "{report:?}");
        let (frames, times) = read_back(&path);
        let mut worst = 0.0f32;
        for (t, obj) in objs.iter().enumerate() {
            assert!((times[t] - t as f32 / 60.0).abs() < 1e-6);
            let (points, faces) = read_obj(obj);
            assert_eq!(faces, topology.faces);
            assert_eq!(points, vertices.frame(t), "an OBJ reads back to the bit");
            for (x, p) in frames.frame(t).iter().zip(&points) {
                worst = worst.max(x.distance(*p));
            }
        }
        assert!(worst < 0.5e-3 && (worst - report.max_error_m).abs() < 5e-6, "{worst} {report:?}");
    }
}

#[test]
fn point_caches_hold_every_frame_to_the_bit_and_bring_their_mesh() {
    let (topology, vertices) = (tube(), motion(7));
    let animation = animation(&topology, &vertices);
    let dir = tempfile::tempdir().unwrap();
    for (file, kind, header) in [("tube.pc2", PointCache::Pc2, 32), ("tube.MDD", PointCache::Mdd, 8 + 4 * 7)] {
        let path = dir.path().join(file);
        assert_eq!(PointCache::of(&path), Some(kind));
        let mesh = write_point_cache(&path, kind, &animation, &Silent).unwrap();
        assert_eq!(read_obj(&mesh), (vertices.frame(0).to_vec(), topology.faces.clone()));
        let bytes = std::fs::read(&path).unwrap();
        let (head, body) = bytes.split_at(header);
        let word = |i: usize| <[u8; 4]>::try_from(&head[i..i + 4]).unwrap();
        let read: fn([u8; 4]) -> f32 = match kind {
            PointCache::Pc2 => {
                assert_eq!(&head[..12], b"POINTCACHE2\0");
                assert_eq!([12, 16, 28].map(|i| i32::from_le_bytes(word(i))), [1, (RINGS * AROUND + 2) as i32, 7]);
                assert_eq!([20, 24].map(|i| f32::from_le_bytes(word(i))), [0.0, 1.0]);
                f32::from_le_bytes
            }
            PointCache::Mdd => {
                assert_eq!([0, 4].map(|i| i32::from_be_bytes(word(i))), [7, (RINGS * AROUND + 2) as i32]);
                (0..7).for_each(|t| assert_eq!(f32::from_be_bytes(word(8 + 4 * t)), t as f32 / 60.0));
                f32::from_be_bytes
            }
        };
        let numbers: Vec<f32> = body.chunks(4).map(|b| read(b.try_into().unwrap())).collect();
        assert_eq!(Frames::from_numbers(RINGS * AROUND + 2, &numbers), vertices);
    }
}

#[test]
fn a_usd_stage_has_a_sample_of_points_normals_and_extent_a_frame() {
    let (topology, vertices) = (tube(), motion(3));
    let coordinates = [Vec2::ZERO, Vec2::new(0.25, 1.0), Vec2::X];
    let faces = vec![[0, 1, 2]; topology.faces.len()];
    let uv = Some(Uv { coordinates: &coordinates, faces: &faces });
    let extras = serde_json::json!({"by": "a \"quoted\" \\ name"});
    let animation = Animation { uv, fps: 24.0, extras: &extras, ..animation(&topology, &vertices) };
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("tube.usda");
    write_usd(&path, &animation, &Silent).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    for line in [
        "#usda 1.0",
        "    endTimeCode = 2",
        "    timeCodesPerSecond = 24",
        "    upAxis = \"Y\"",
        "    metersPerUnit = 1",
    ] {
        assert!(text.lines().any(|l| l == line), "{line}");
    }
    assert!(text.contains(r#"string about = "{\"by\":\"a \\\"quoted\\\" \\\\ name\"}""#), "{text:.400}");
    assert!(text.contains("primvars:st = [(0, 0), (0.25, 1), (1, 0)]"));
    // samples of an attribute, numbers in the order of the text
    let samples = |attribute: &str| -> Vec<Vec<f32>> {
        let block = text.split(&format!("{attribute}.timeSamples = {{\n")).nth(1).unwrap().split('}').next().unwrap();
        let numbers = |line: &str| {
            let (_, list) = line.split_once(": ").unwrap();
            list.split(|c: char| "[](), ".contains(c)).filter(|w| !w.is_empty()).map(|w| w.parse().unwrap()).collect()
        };
        block.lines().filter(|l| l.contains('[')).map(numbers).collect()
    };
    let (points, normals, extents) = (samples("points"), samples("normals"), samples("extent"));
    assert_eq!([points.len(), normals.len(), extents.len()], [3; 3]);
    for t in 0..3 {
        assert_eq!(Frames::from_numbers(vertices.points_per_frame(), &points[t]).frame(0), vertices.frame(t));
        assert!(normals[t].chunks(3).all(|n| (Vec3::from_slice(n).length() - 1.0).abs() < 1e-5));
        let (low, high) = (Vec3::from_slice(&extents[t][..3]), Vec3::from_slice(&extents[t][3..]));
        assert!(vertices.frame(t).iter().all(|p| p.cmpge(low).all() && p.cmple(high).all()));
        assert!(low.to_array().iter().all(|x| points[t].contains(x)));
    }
}

#[test]
fn obj_files_carry_texture_coordinates() {
    let (topology, vertices) = (tube(), motion(1));
    let (coordinates, faces) = ([Vec2::ZERO, Vec2::X, Vec2::Y], vec![[2, 0, 1]; topology.faces.len()]);
    let uv = Some(Uv { coordinates: &coordinates, faces: &faces });
    let dir = tempfile::tempdir().unwrap();
    let good = Animation { uv, ..animation(&topology, &vertices) };
    let path = &write_obj_sequence(dir.path(), &good, &Silent).unwrap()[0];
    let text = std::fs::read_to_string(path).unwrap();
    let [a, b, c] = topology.faces[0].map(|i| i + 1);
    assert!(text.contains("vt 1 0\n") && text.contains(&format!("f {a}/3 {b}/1 {c}/2\n")));
    let few = Some(Uv { coordinates: &coordinates[..2], faces: &faces });
    let refused = write_obj_sequence(dir.path(), &Animation { uv: few, ..good }, &Silent).unwrap_err().to_string();
    assert!(refused.contains("texture coordinates"), "{refused}");
}

#[test]
fn a_folder_holds_surfaces_of_any_topology() {
    let dir = tempfile::tempdir().unwrap();
    let folder = ObjFolder::create(dir.path(), 2).unwrap();
    for count in [3usize, 4] {
        let positions: Vec<Vec3> = (0..count).map(|i| Vec3::new(i as f32, (i * i) as f32, 0.5)).collect();
        let faces: Vec<[u32; 3]> = (2..count as u32).map(|i| [0, i - 1, i]).collect();
        let normals = vec![Vec3::Z; count];
        let frame =
            SurfaceFrame { name: "a field", fps: 60.0, positions: &positions, normals: &normals, faces: &faces };
        folder.write(count - 3, &frame).unwrap();
        let path = dir.path().join(format!("frame_{:05}.obj", count - 3));
        assert_eq!(read_obj(&path), (positions.clone(), faces.clone()));
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.matches("vn 0 0 1\n").count(), count);
        assert!(folder.write(2, &frame).is_err());
    }
    let refused = ObjFolder::create(dir.path(), 1).err().expect("it holds a longer sequence").to_string();
    assert!(refused.contains("frame_00001.obj"), "{refused}");
}

#[test]
fn normals_follow_the_surface() {
    let (topology, vertices) = (tube(), motion(60));
    let animation = animation(&topology, &vertices);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("tube.glb");
    write_gltf(&path, &animation, &GltfConfig::default(), &Silent).unwrap();
    let (document, buffers, _) = gltf::import(&path).unwrap();
    let data = |buffer: gltf::Buffer| Some(&buffers[buffer.index()].0[..]);
    let primitive = document.meshes().next().unwrap().primitives().next().unwrap();
    let reader = primitive.reader(data);
    let base: Vec<Vec3> = reader.read_normals().unwrap().map(Vec3::from).collect();
    let targets: Vec<Vec<Vec3>> =
        reader.read_morph_targets().map(|(_, n, _)| n.unwrap().map(Vec3::from).collect()).collect();
    let weights: Vec<f32> = document
        .animations()
        .next()
        .unwrap()
        .channels()
        .find_map(|c| match c.reader(data).read_outputs().unwrap() {
            gltf::animation::util::ReadOutputs::MorphTargetWeights(w) => Some(w.into_f32().collect()),
            _ => None,
        })
        .unwrap();
    let mut sum = 0.0;
    for t in 0..60 {
        let exact = softtissue_geometry::vertex_normals(vertices.frame(t), &topology.faces);
        for v in 0..base.len() {
            let w = &weights[t * targets.len()..(t + 1) * targets.len()];
            let n = targets.iter().zip(w).fold(base[v], |n, (target, w)| n + target[v] * *w);
            sum += n.angle_between(exact[v]).to_degrees() / (60 * base.len()) as f32;
        }
    }
    assert!(sum < 2.0, "mean angle {sum} degrees");
}

#[test]
fn one_frame_and_exact_frames() {
    let topology = tube();
    let dir = tempfile::tempdir().unwrap();
    for (frames, tolerance_m) in [(1, 0.25e-3), (12, 0.0)] {
        let vertices = motion(frames);
        let animation = Animation { fps: 30.0, ..animation(&topology, &vertices) };
        let path = dir.path().join("still.glb");
        let config = GltfConfig { tolerance_m, normals: false, ..Default::default() };
        let report = write_gltf(&path, &animation, &config, &Silent).unwrap();
        assert!(report.max_error_m < 1e-6, "{report:?}");
        let (back, _) = read_back(&path);
        assert_eq!(back.len(), frames);
        for (x, p) in back.points().iter().zip(vertices.points()) {
            assert!(x.distance(*p) < 2e-6);
        }
    }
}

#[test]
fn the_same_motion_gives_the_same_bytes() {
    let (topology, vertices) = (tube(), motion(30));
    let animation = animation(&topology, &vertices);
    let dir = tempfile::tempdir().unwrap();
    let write = |file: &str| {
        let path = dir.path().join(file);
        write_gltf(&path, &animation, &GltfConfig::default(), &Silent).unwrap();
        std::fs::read(path).unwrap()
    };
    assert_eq!(write("a.glb"), write("b.glb"));
}

#[test]
fn bad_animations_and_targets_are_refused_and_nothing_is_written() {
    let (topology, vertices) = (tube(), motion(3));
    let good = animation(&topology, &vertices);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.glb");
    let mut broken = vertices.clone();
    broken.frame_mut(2)[7].y = f32::NAN;
    let (none, few) = (Frames::new(5), Frames::zeros(5, 2));
    for (animation, says) in [
        (Animation { vertices: &broken, ..good }, "vertex 7 of frame 2"),
        (Animation { vertices: &none, ..good }, "no frame"),
        (Animation { vertices: &few, ..good }, "5 vertices"),
        (Animation { fps: 0.0, ..good }, "0 frames a second"),
        (Animation { fps: f32::NAN, ..good }, "NaN frames a second"),
    ] {
        let message = write_gltf(&path, &animation, &GltfConfig::default(), &Silent).unwrap_err().to_string();
        assert!(message.contains(says), "{message}");
        assert!(
            write_obj_sequence(&dir.path().join("obj"), &animation, &Silent).unwrap_err().to_string().contains(says)
        );
    }
    let message =
        write_gltf(&dir.path().join("a.fbx"), &good, &GltfConfig::default(), &Silent).unwrap_err().to_string();
    assert!(message.contains(".glb"), "{message}");
    let message = write_usd(&path, &good, &Silent).unwrap_err().to_string();
    assert!(message.contains(".usda"), "{message}");
    let stop = Stopped;
    for (file, kind) in [("a.pc2", PointCache::Pc2), ("a.mdd", PointCache::Mdd)] {
        let path = dir.path().join(file);
        assert!(matches!(write_point_cache(&path, kind, &good, &stop), Err(ExportError::Stopped)));
    }
    assert!(matches!(write_usd(&dir.path().join("a.usda"), &good, &stop), Err(ExportError::Stopped)));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    // A folder of a longer sequence.
    let obj = dir.path().join("obj");
    write_obj_sequence(&obj, &Animation { vertices: &motion(5), ..good }, &Silent).unwrap();
    assert!(matches!(write_obj_sequence(&obj, &good, &Silent), Err(ExportError::Target { .. })));
}
