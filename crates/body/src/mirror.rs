use crate::{BodyError, Mirror, Result};
use glam::Vec3;
use softtissue_geometry::{Frames, reflect_axis_angle_x};

/// Reflection in the plane `x = 0` swaps left and right. Every map here is its own inverse.
impl Mirror {
    /// Refuses maps that are no involutions.
    pub fn check(&self) -> Result<()> {
        let vertices = self.vertices.iter().map(|&v| v as usize).collect::<Vec<_>>();
        let joints = self.joints.iter().map(|&j| j as usize).collect::<Vec<_>>();
        for (what, map) in [("vertex", vertices), ("joint", joints)] {
            if let Some(i) = (0..map.len()).find(|&i| map.get(map[i]) != Some(&i)) {
                return Err(BodyError::Inconsistent(format!(
                    "its mirror takes {what} {i} to {}, but not back",
                    map[i]
                )));
            }
        }
        Ok(())
    }

    /// Joint rotations `[J]` of the mirrored pose.
    pub fn rotations(&self, rotations: &[Vec3]) -> Vec<Vec3> {
        assert_eq!(rotations.len(), self.joints.len(), "joints of a pose");
        self.joints.iter().map(|&j| reflect_axis_angle_x(rotations[j as usize])).collect()
    }

    /// A root translation, reflected.
    pub fn translation(&self, translation: Vec3) -> Vec3 {
        reflect_x(translation)
    }

    /// A motion: rotations `[T, J]` and root translations `[T]`.
    pub fn motion(&self, rotations: &Frames, translations: &[Vec3]) -> (Frames, Vec<Vec3>) {
        assert_eq!(rotations.len(), translations.len(), "frames of a motion");
        let mut mirrored = Frames::new(rotations.points_per_frame());
        for frame in rotations.iter() {
            mirrored.push(&self.rotations(frame));
        }
        (mirrored, translations.iter().map(|t| reflect_x(*t)).collect())
    }

    /// Vertices or displacements of vertices `[V]`, at rest or posed.
    pub fn field(&self, field: &[Vec3]) -> Vec<Vec3> {
        assert_eq!(field.len(), self.vertices.len(), "vertices of a field");
        self.vertices.iter().map(|&v| reflect_x(field[v as usize])).collect()
    }

    /// Vertices or deltas of many frames `[T, V]`.
    pub fn fields(&self, fields: &Frames) -> Frames {
        let mut mirrored = Frames::new(fields.points_per_frame());
        for frame in fields.iter() {
            mirrored.push(&self.field(frame));
        }
        mirrored
    }
}

fn reflect_x(p: Vec3) -> Vec3 {
    Vec3::new(-p.x, p.y, p.z)
}
