use glam::Vec3;

/// Where the picture is taken from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position, metres.
    pub eye: Vec3,
    /// Point in the middle of the picture.
    pub target: Vec3,
    /// Vertical angle of view, radians.
    pub field_of_view: f32,
}

impl Camera {
    /// Looks at `centre` from the direction of `azimuth` (0 = from +Z, a quarter turn = from +X) and `elevation`,
    /// radians, from far enough to see a sphere of `radius` metres.
    pub fn around(centre: Vec3, radius: f32, azimuth: f32, elevation: f32) -> Self {
        let field_of_view = 0.45f32;
        let distance = radius / (field_of_view * 0.5).sin();
        let direction = Vec3::new(azimuth.sin() * elevation.cos(), elevation.sin(), azimuth.cos() * elevation.cos());
        Self { eye: centre + direction * distance, target: centre, field_of_view }
    }

    /// Like [`Camera::around`] for the bounding box of some points; the origin if there is none.
    pub fn framing(points: &[Vec3], azimuth: f32, elevation: f32) -> Self {
        let (low, high) = points
            .iter()
            .filter(|p| p.is_finite())
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), p| (l.min(*p), h.max(*p)));
        if low.x > high.x {
            return Self::around(Vec3::ZERO, 1.0, azimuth, elevation);
        }
        Self::around((low + high) * 0.5, (high - low).length() * 0.48, azimuth, elevation)
    }

    /// Unit vector from the target to the eye.
    pub fn towards_eye(&self) -> Vec3 {
        (self.eye - self.target).normalize_or(Vec3::Z)
    }

    /// Right, up and back (towards the eye) of the picture, unit, in the world.
    pub fn axes(&self) -> [Vec3; 3] {
        let back = self.towards_eye();
        let up = if back.y.abs() > 0.999 { Vec3::NEG_Z } else { Vec3::Y };
        let right = up.cross(back).normalize();
        [right, back.cross(right), back]
    }
}
