use crate::morph::MorphAnimation;
use crate::{Animation, ExportError, Result};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use softtissue_geometry::{Frames, vertex_normals};
use softtissue_monitor::Monitor;
use softtissue_store::write_atomic;
use std::path::Path;

/// How an animated glTF is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GltfConfig {
    /// How far a vertex may be from where it should be in any frame, metres. Default 0.25 mm; smaller makes
    /// larger files, zero keeps every frame exactly.
    pub tolerance_m: f32,
    /// Whether morph targets carry normals too, for smooth shading that moves along. Default true; false halves the file, and
    /// viewers shade flat.
    pub normals: bool,
    /// Colour of the material, linear RGB.
    pub colour: [f32; 3],
}

impl Default for GltfConfig {
    fn default() -> Self {
        Self { tolerance_m: 0.25e-3, normals: true, colour: [0.76, 0.55, 0.44] }
    }
}

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GltfReport {
    /// Morph targets.
    pub targets: usize,
    /// Largest distance of a vertex from where it should be, metres.
    pub max_error_m: f32,
    /// Size of the file or files.
    pub bytes: usize,
}

/// glTF's names for types and uses of data.
const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// Writes glTF 2.0: `.glb` in one file, `.gltf` with its data in a `.bin` beside it.
///
/// The mesh moves by morph targets and by the translation of its node, which follows the centre of the vertices. A target
/// a frame would be exact but large; as few targets are kept as `tolerance_m` allows, and what was reached
/// stands in `asset.extras`. One key a frame at `t / fps`, linear in between.
pub fn write_gltf(
    path: &Path,
    animation: &Animation,
    config: &GltfConfig,
    monitor: &dyn Monitor,
) -> Result<GltfReport> {
    animation.check()?;
    let binary = match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
        Some("glb") => true,
        Some("gltf") => false,
        _ => {
            return Err(ExportError::Target {
                path: path.to_owned(),
                reason: "its name ends neither in .glb nor in .gltf; name it so".into(),
            });
        }
    };
    monitor.begin("glTF", animation.vertices.len() as u64, "targets");
    let morph = MorphAnimation::new(animation.vertices, config.tolerance_m, monitor)?;
    let mut scene = Scene::default();
    scene.build(animation, &morph, config);
    monitor.end();
    if scene.data.len() > u32::MAX as usize - (64 << 20) {
        return Err(ExportError::Target {
            path: path.to_owned(),
            reason: "it would exceed glTF's 4 GiB; export it in parts".into(),
        });
    }
    let bytes = if binary { scene.write_glb(path)? } else { scene.write_gltf(path)? };
    Ok(GltfReport { targets: morph.target_count(), max_error_m: morph.max_error_m, bytes })
}

/// A glTF document under construction.
#[derive(Default)]
struct Scene {
    data: Vec<u8>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    document: Value,
}

impl Scene {
    fn build(&mut self, animation: &Animation, morph: &MorphAnimation, config: &GltfConfig) {
        let Animation { name, topology, fps, vertices, extras, .. } = *animation;
        let normals = config.normals.then(|| normals_of(vertices, &topology.faces));
        let indices = self.indices(&topology.faces);
        let (first, start) = (self.accessors.len(), self.data.len());
        let position = self.points(&morph.base, start);
        let normal = normals.as_ref().map(|n| self.points(n.frame(0), start));
        let normal_targets = normals.as_ref().map(|n| morph.follow(n));
        let targets: Vec<Value> = (0..morph.target_count())
            .map(|k| {
                let position = self.points(morph.targets.frame(k), start);
                match &normal_targets {
                    Some(n) => json!({"POSITION": position, "NORMAL": self.points(n.frame(k), start)}),
                    None => json!({"POSITION": position}),
                }
            })
            .collect();
        self.vertex_view(first, start);
        let mut attributes = json!({"POSITION": position});
        if let Some(normal) = normal {
            attributes["NORMAL"] = json!(normal);
        }
        let mut primitive = json!({"attributes": attributes, "indices": indices, "material": 0});
        let mut mesh = json!({"name": name});
        if !targets.is_empty() {
            let names: Vec<String> = (0..targets.len()).map(|k| format!("motion {k}")).collect();
            primitive["targets"] = json!(targets);
            mesh["weights"] = json!(morph.frame_weights(0));
            mesh["extras"] = json!({"targetNames": names});
        }
        mesh["primitives"] = json!([primitive]);
        let [r, g, b] = config.colour;
        let mut about = json!({"fps": fps, "frames": vertices.len(), "max_error_mm": morph.max_error_m * 1e3});
        if !extras.is_null() {
            about["softtissue"] = extras.clone();
        }
        self.document = json!({
            "asset": {"version": "2.0", "generator": concat!("softtissue ", env!("CARGO_PKG_VERSION")), "extras": about},
            "scene": 0,
            "scenes": [{"name": name, "nodes": [0]}],
            "nodes": [{"name": name, "mesh": 0, "translation": morph.origins[0].to_array()}],
            "meshes": [mesh],
            "materials": [{
                "name": "skin",
                "pbrMetallicRoughness": {"baseColorFactor": [r, g, b, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.65},
            }],
            "animations": [self.keys(name, fps, morph)],
        });
        self.document["accessors"] = json!(self.accessors);
        self.document["bufferViews"] = json!(self.views);
    }

    /// The animation: translation and weights of node 0, a key a frame.
    fn keys(&mut self, name: &str, fps: f32, morph: &MorphAnimation) -> Value {
        let times: Vec<f32> = (0..morph.origins.len()).map(|t| (t as f64 / f64::from(fps)) as f32).collect();
        let view = self.views.len();
        let start = self.data.len();
        let last = times.len() - 1;
        let input = self.numbers(&times, times.len(), "SCALAR", view, start);
        self.accessors[input]["min"] = json!([times[0]]);
        self.accessors[input]["max"] = json!([times[last]]);
        let translations = self.numbers(bytemuck::cast_slice(&morph.origins), morph.origins.len(), "VEC3", view, start);
        let mut samplers = vec![json!({"input": input, "output": translations, "interpolation": "LINEAR"})];
        let mut channels = vec![json!({"sampler": 0, "target": {"node": 0, "path": "translation"}})];
        if !morph.weights.is_empty() {
            let weights = self.numbers(&morph.weights, morph.weights.len(), "SCALAR", view, start);
            samplers.push(json!({"input": input, "output": weights, "interpolation": "LINEAR"}));
            channels.push(json!({"sampler": 1, "target": {"node": 0, "path": "weights"}}));
        }
        self.views.push(json!({"buffer": 0, "byteOffset": start, "byteLength": self.data.len() - start}));
        json!({"name": name, "samplers": samplers, "channels": channels})
    }

    fn indices(&mut self, faces: &[[u32; 3]]) -> usize {
        let start = self.data.len();
        self.data.extend(faces.iter().flatten().flat_map(|i| i.to_le_bytes()));
        let view = json!({"buffer": 0, "byteOffset": start, "byteLength": self.data.len() - start, "target": ELEMENT_ARRAY_BUFFER});
        self.views.push(view);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": UNSIGNED_INT, "count": faces.len() * 3, "type": "SCALAR",
        }));
        self.accessors.len() - 1
    }

    /// Vertex data in the view that starts at `start` and comes next; with bounds, which positions must have.
    fn points(&mut self, points: &[Vec3], start: usize) -> usize {
        let view = self.views.len();
        let accessor = self.numbers(bytemuck::cast_slice(points), points.len(), "VEC3", view, start);
        let low = points.iter().fold(Vec3::INFINITY, |m, p| m.min(*p));
        let high = points.iter().fold(Vec3::NEG_INFINITY, |m, p| m.max(*p));
        self.accessors[accessor]["min"] = json!(low.to_array());
        self.accessors[accessor]["max"] = json!(high.to_array());
        accessor
    }

    fn vertex_view(&mut self, first_accessor: usize, start: usize) {
        debug_assert!(first_accessor < self.accessors.len(), "vertex data");
        let length = self.data.len() - start;
        self.views.push(
            json!({"buffer": 0, "byteOffset": start, "byteLength": length, "byteStride": 12, "target": ARRAY_BUFFER}),
        );
    }

    fn numbers(&mut self, numbers: &[f32], count: usize, kind: &str, view: usize, start: usize) -> usize {
        let offset = self.data.len() - start;
        self.data.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        self.accessors.push(json!({
            "bufferView": view, "byteOffset": offset, "componentType": FLOAT, "count": count, "type": kind,
        }));
        self.accessors.len() - 1
    }

    fn write_gltf(mut self, path: &Path) -> Result<usize> {
        let bin = path.with_extension("bin");
        let name = bin.file_name().and_then(|n| n.to_str()).unwrap_or_default().to_owned();
        self.document["buffers"] = json!([{"byteLength": self.data.len(), "uri": percent_encoded(&name)}]);
        let text = self.document.to_string();
        write_atomic(&bin, |w| w.write_all(&self.data))?;
        write_atomic(path, |w| w.write_all(text.as_bytes()))?;
        Ok(text.len() + self.data.len())
    }

    fn write_glb(mut self, path: &Path) -> Result<usize> {
        self.document["buffers"] = json!([{"byteLength": self.data.len()}]);
        let mut text = self.document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let length = 12 + 8 + text.len() + 8 + self.data.len();
        write_atomic(path, |w| {
            let word = |n: usize| (n as u32).to_le_bytes();
            w.write_all(b"glTF")?;
            w.write_all(&word(2))?;
            w.write_all(&word(length))?;
            w.write_all(&word(text.len()))?;
            w.write_all(b"JSON")?;
            w.write_all(&text)?;
            w.write_all(&word(self.data.len()))?;
            w.write_all(b"BIN\0")?;
            w.write_all(&self.data)
        })?;
        Ok(length)
    }
}

/// Unit vertex normals of every frame, `[T, V]`; straight up where a vertex has no area, as a file must hold units.
fn normals_of(vertices: &Frames, faces: &[[u32; 3]]) -> Frames {
    let mut normals = Frames::new(vertices.points_per_frame());
    for frame in vertices.iter() {
        let mut n = vertex_normals(frame, faces);
        n.iter_mut().filter(|n| **n == Vec3::ZERO).for_each(|n| *n = Vec3::Y);
        normals.push(&n);
    }
    normals
}

/// A file name as a relative URI.
fn percent_encoded(name: &str) -> String {
    let keep = |b: u8| b.is_ascii_alphanumeric() || b"-._~".contains(&b);
    name.bytes().map(|b| if keep(b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}
