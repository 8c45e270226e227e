use crate::{BodyError, BodyModel, JointRegressor, Mirror, Region, RegionMap, Result, Skeleton, SkinWeights, UvAtlas};
use glam::{Vec2, Vec3};
use softtissue_geometry::Topology;
use softtissue_store::{DType, StoreError, TensorFile, TensorFileWriter};
use std::path::Path;
use std::sync::Arc;

/// How far skin weights may be from summing to one.
const WEIGHT_TOLERANCE: f32 = 1e-4;

impl BodyModel {
    /// Writes the body as one tensor file.
    pub fn write(&self, path: &Path) -> Result<()> {
        let (v, j) = (self.vertex_count(), self.joint_count());
        let per_vertex = |points: &[Vec3]| [points.len() / v.max(1), v, 3];
        let rows = &self.joint_regressor.rows;
        let counts: Vec<u32> = rows.iter().map(|r| r.len() as u32).collect();
        let (joint_vertices, joint_weights): (Vec<u32>, Vec<f32>) = rows.iter().flatten().copied().unzip();
        let skin_joints = self.skin.iter().flat_map(|s| s.joints).collect();
        let skin_weights: Vec<f32> = self.skin.iter().flat_map(|s| s.weights).collect();
        let regions =
            self.regions.0.iter().map(|r| Region::ALL.iter().position(|a| a == r).unwrap_or(0) as u8).collect();
        let topology = &self.topology;
        let mut file = TensorFileWriter::new();
        file.meta("softtissue", "1").meta("kind", "body");
        file.meta("joint_names", serde_json::json!(self.skeleton.names).to_string());
        file.meta("joint_parents", serde_json::json!(self.skeleton.parents).to_string());
        file.u32("topology.faces", &[topology.faces.len(), 3], topology.faces.as_flattened());
        file.u32("topology.quads", &[topology.quads.len(), 4], topology.quads.as_flattened());
        file.f32("template", &[v, 3], bytemuck::cast_slice(&self.template));
        file.f32("shape_directions", &per_vertex(&self.shape_directions), bytemuck::cast_slice(&self.shape_directions));
        file.f32("pose_directions", &per_vertex(&self.pose_directions), bytemuck::cast_slice(&self.pose_directions));
        file.u32("joint_regressor.counts", &[j], &counts);
        file.u32("joint_regressor.vertices", &[joint_vertices.len()], &joint_vertices);
        file.f32("joint_regressor.weights", &[joint_weights.len()], &joint_weights);
        file.raw("skin.joints", DType::U8, &[v, 4], skin_joints);
        file.f32("skin.weights", &[v, 4], &skin_weights);
        file.f32("uv.coordinates", &[self.uv.coordinates.len(), 2], bytemuck::cast_slice(&self.uv.coordinates));
        file.u32("uv.faces", &[self.uv.faces.len(), 3], self.uv.faces.as_flattened());
        file.u32("mirror.vertices", &[v], &self.mirror.vertices);
        file.raw("mirror.joints", DType::U8, &[j], self.mirror.joints.clone());
        file.raw("regions", DType::U8, &[v], regions);
        Ok(file.write(path)?)
    }

    /// Reads and checks a body: finite numbers, indices inside, weights that sum to one, parents before children.
    pub fn read(path: &Path) -> Result<Self> {
        Self::from_file(&TensorFile::open(path)?)
    }

    /// The same of a file that is open, in memory for example.
    pub fn from_file(file: &TensorFile) -> Result<Self> {
        let reader = Reader { file, path: file.path() };
        if file.require_meta("kind")? != "body" {
            return Err(reader.bad("it is no body"));
        }
        let v = file.require_shape("template", 2)?[0];
        let names: Vec<String> = reader.json("joint_names")?;
        let parents: Vec<Option<u8>> = reader.json("joint_parents")?;
        let faces = reader.index_rows::<3>("topology.faces", None)?;
        let quads = reader.index_rows::<4>("topology.quads", None)?;
        let topology = Topology { vertex_count: v, faces, quads };
        let (j, f) = (names.len(), topology.faces.len());
        let weights = reader.numbers("skin.weights", &[v, 4])?;
        let joints = reader.bytes("skin.joints", &[v, 4])?;
        let skin = joints.as_chunks::<4>().0.iter().zip(weights.as_chunks::<4>().0);
        let features = 9 * j.saturating_sub(1);
        // An atlas may be empty, but not partial.
        let uv_faces = Some(f).filter(|_| file.shape("uv.faces").is_none_or(|(_, shape)| shape.first() != Some(&0)));
        let uv_count = file.require_shape("uv.coordinates", 2)?[0];
        let coordinates = reader.numbers("uv.coordinates", &[uv_count, 2])?;
        let regions = reader.bytes("regions", &[v])?;
        let region = |r: &u8| Region::ALL.get(usize::from(*r)).copied();
        let regions: Option<Vec<Region>> = regions.iter().map(region).collect();
        let shapes = file.require_shape("shape_directions", 3)?[0];
        let body = Self {
            template: reader.points("template", &[v, 3])?,
            shape_directions: reader.points("shape_directions", &[shapes, v, 3])?,
            pose_directions: reader.points("pose_directions", &[features, v, 3])?,
            joint_regressor: reader.joint_regressor(j)?,
            skin: skin.map(|(joints, weights)| SkinWeights { joints: *joints, weights: *weights }).collect(),
            skeleton: Skeleton { names, parents },
            uv: UvAtlas {
                coordinates: coordinates.as_chunks::<2>().0.iter().map(|c| Vec2::from_array(*c)).collect(),
                faces: reader.index_rows::<3>("uv.faces", uv_faces)?,
            },
            mirror: Mirror {
                vertices: reader.indices("mirror.vertices", &[v])?,
                joints: reader.bytes("mirror.joints", &[j])?,
            },
            regions: RegionMap(regions.ok_or_else(|| reader.bad("it names an unknown region"))?),
            topology: Arc::new(topology),
        };
        body.check_parts().map_err(|reason| reader.bad(&reason))?;
        body.mirror.check().map_err(|e| reader.bad(&e.to_string()))?;
        Ok(body)
    }

    /// Refuses a body whose parts do not fit together: array lengths, finite numbers, indices, weights that sum to
    /// one, parents before children, a mirror that is an involution. What [`BodyModel::read`] returns passes.
    pub fn check(&self) -> Result<()> {
        self.check_sizes().and_then(|()| self.check_parts()).map_err(BodyError::Inconsistent)?;
        self.mirror.check()
    }

    /// Whether arrays are as long as the counts say and numbers are finite.
    fn check_sizes(&self) -> std::result::Result<(), String> {
        let (v, j) = (self.vertex_count(), self.joint_count());
        let uv_faces = if self.uv.faces.is_empty() { 0 } else { self.topology.faces.len() };
        let lengths = [
            ("vertices of the topology", self.topology.vertex_count, v),
            ("shape directions", self.shape_directions.len(), self.shape_count() * v),
            ("pose directions", self.pose_directions.len(), 9 * j.saturating_sub(1) * v),
            ("rows of the joint regressor", self.joint_regressor.rows.len(), j),
            ("skin weights", self.skin.len(), v),
            ("faces of the atlas", self.uv.faces.len(), uv_faces),
            ("mirrored vertices", self.mirror.vertices.len(), v),
            ("mirrored joints", self.mirror.joints.len(), j),
            ("regions", self.regions.0.len(), v),
        ];
        if let Some((what, found, expected)) = lengths.into_iter().find(|(_, found, expected)| found != expected) {
            return Err(format!("it has {found} {what}, expected {expected}"));
        }
        let fields = [&self.template, &self.shape_directions, &self.pose_directions];
        let finite = fields.iter().all(|f| f.iter().all(|p| p.is_finite()))
            && self.joint_regressor.rows.iter().flatten().all(|(_, w)| w.is_finite())
            && self.uv.coordinates.iter().all(|c| c.is_finite());
        if finite { Ok(()) } else { Err("a number in it is not finite".into()) }
    }

    /// Whether every index points at something and every weight counts.
    fn check_parts(&self) -> std::result::Result<(), String> {
        let (v, j) = (self.vertex_count(), self.joint_count());
        if v == 0 || j == 0 || self.skeleton.parents.len() != j {
            return Err("it has no vertex, no joint, or joints without parents".into());
        }
        self.topology.check_indices().map_err(|e| e.to_string())?;
        if self.topology.quads.iter().flatten().any(|i| *i as usize >= v) {
            return Err("a quad names a vertex past the last".into());
        }
        for (i, parent) in self.skeleton.parents.iter().enumerate() {
            if parent.map_or(i != 0, |p| usize::from(p) >= i) {
                return Err(format!("joint {i} does not come after its parent"));
            }
        }
        for (i, skin) in self.skin.iter().enumerate() {
            let sum: f32 = skin.weights.iter().sum();
            let fine = (sum - 1.0).abs() <= WEIGHT_TOLERANCE && skin.weights.iter().all(|w| *w >= 0.0);
            if !fine || skin.joints.iter().any(|k| usize::from(*k) >= j) {
                return Err(format!(
                    "the skin weights of vertex {i} are negative, do not sum to one, or name no joint"
                ));
            }
        }
        let uv = self.uv.coordinates.len();
        let outside = self.uv.faces.iter().flatten().any(|i| *i as usize >= uv)
            || self.joint_regressor.rows.iter().flatten().any(|(i, _)| *i as usize >= v)
            || self.mirror.vertices.iter().any(|i| *i as usize >= v)
            || self.mirror.joints.iter().any(|i| usize::from(*i) >= j);
        if outside {
            return Err("its atlas, joints or mirror name something past the last".into());
        }
        Ok(())
    }
}

struct Reader<'a> {
    file: &'a TensorFile,
    path: &'a Path,
}

impl Reader<'_> {
    fn bad(&self, reason: &str) -> BodyError {
        StoreError::corrupt(self.path, format!("{reason}; make it again")).into()
    }
    fn shape(&self, name: &str, expected: &[usize]) -> Result<()> {
        let found = self.file.require_shape(name, expected.len())?;
        if found != expected {
            return Err(self.bad(&format!("{name} has shape {found:?}, expected {expected:?}")));
        }
        Ok(())
    }
    fn numbers(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>> {
        self.shape(name, shape)?;
        let numbers = self.file.f32(name)?;
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(i) => Err(self.bad(&format!("{name} holds {} at place {i}", numbers[i]))),
            None => Ok(numbers),
        }
    }
    fn points(&self, name: &str, shape: &[usize]) -> Result<Vec<Vec3>> {
        Ok(self.numbers(name, shape)?.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p)).collect())
    }
    fn indices(&self, name: &str, shape: &[usize]) -> Result<Vec<u32>> {
        self.shape(name, shape)?;
        Ok(self.file.u32(name)?)
    }
    fn index_rows<const N: usize>(&self, name: &str, rows: Option<usize>) -> Result<Vec<[u32; N]>> {
        let rows = rows.unwrap_or(self.file.require_shape(name, 2)?[0]);
        Ok(self.indices(name, &[rows, N])?.as_chunks::<N>().0.to_vec())
    }
    fn bytes(&self, name: &str, shape: &[usize]) -> Result<Vec<u8>> {
        self.shape(name, shape)?;
        Ok(self.file.bytes(name, DType::U8, None)?)
    }
    fn json<T: serde::de::DeserializeOwned>(&self, key: &str) -> Result<T> {
        let text = self.file.require_meta(key)?;
        serde_json::from_str(text).map_err(|e| self.bad(&format!("its {key} are broken ({e})")))
    }
    fn joint_regressor(&self, joints: usize) -> Result<JointRegressor> {
        let counts = self.indices("joint_regressor.counts", &[joints])?;
        let total: u64 = counts.iter().map(|c| u64::from(*c)).sum();
        let total = usize::try_from(total).map_err(|_| self.bad("its joint regressor is too long"))?;
        let vertices = self.indices("joint_regressor.vertices", &[total])?;
        let weights = self.numbers("joint_regressor.weights", &[total])?;
        let mut pairs = vertices.into_iter().zip(weights);
        Ok(JointRegressor { rows: counts.iter().map(|c| pairs.by_ref().take(*c as usize).collect()).collect() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tetrahedron of two joints.
    fn small() -> BodyModel {
        let faces = vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        let skin = |w: f32| SkinWeights { joints: [0, 1, 0, 0], weights: [1.0 - w, w, 0.0, 0.0] };
        BodyModel {
            topology: Arc::new(Topology { vertex_count: 4, faces: faces.clone(), quads: vec![[0, 1, 2, 3]] }),
            template: vec![Vec3::ZERO, Vec3::X, Vec3::NEG_X, Vec3::Y],
            shape_directions: vec![Vec3::splat(0.1); 4],
            pose_directions: (0..36).map(|i| Vec3::splat(i as f32)).collect(),
            joint_regressor: JointRegressor { rows: vec![vec![(0, 1.0)], vec![(1, 0.5), (2, 0.5)]] },
            skin: [0.0, 0.25, 0.5, 0.75].map(skin).to_vec(),
            skeleton: Skeleton { names: vec!["root".into(), "tip".into()], parents: vec![None, Some(0)] },
            uv: UvAtlas { coordinates: vec![Vec2::ZERO, Vec2::X, Vec2::Y], faces: vec![[0, 1, 2]; 4] },
            mirror: Mirror { vertices: vec![0, 2, 1, 3], joints: vec![0, 1] },
            regions: RegionMap(vec![Region::Belly, Region::Rest, Region::Feet, Region::Chest]),
        }
    }

    #[test]
    fn a_body_reads_back_the_same() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("body.safetensors");
        let body = small();
        body.write(&path).unwrap();
        let read = BodyModel::read(&path).unwrap();
        assert_eq!(format!("{read:?}"), format!("{body:?}"));
    }

    #[test]
    fn broken_bodies_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("body.safetensors");
        type Break = fn(&mut BodyModel);
        let breaks: [(Break, &str); 6] = [
            (|b| b.template[2].y = f32::NAN, "template holds NaN"),
            (|b| b.skin[1].weights[0] = 0.5, "skin weights of vertex 1"),
            (|b| b.skin[3].joints[1] = 7, "skin weights of vertex 3"),
            (|b| b.skeleton.parents[1] = Some(1), "joint 1"),
            (|b| b.mirror.vertices[1] = 9, "past the last"),
            (|b| b.joint_regressor.rows[0][0].0 = 4, "past the last"),
        ];
        for (break_it, says) in breaks {
            let mut body = small();
            break_it(&mut body);
            body.write(&path).unwrap();
            let message = BodyModel::read(&path).unwrap_err().to_string();
            assert!(message.contains(says) && message.contains("body.safetensors"), "{message}");
        }
    }
}
